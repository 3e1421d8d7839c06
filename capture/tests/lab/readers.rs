//! Recordings as other people's programs read them.

use std::collections::BTreeMap;
use std::process::Command;

use super::python;

/// Counts the messages by topic as PyPI's `mcap` reads them; of a file that ends in a part of a chunk, which `torn:` says, those up to there.
const COUNT: &str = "import collections, json, sys\n\
    from mcap.exceptions import EndOfFile\n\
    from mcap.reader import NonSeekingReader, make_reader\n\
    counts = []\n\
    for word in sys.argv[1:]:\n\
    \x20   path = word.removeprefix('torn:')\n\
    \x20   count = collections.Counter()\n\
    \x20   with open(path, 'rb') as file:\n\
    \x20       reader = make_reader(file) if path == word else NonSeekingReader(file)\n\
    \x20       try:\n\
    \x20           for schema, channel, message in reader.iter_messages(log_time_order=False):\n\
    \x20               count[channel.topic] += 1\n\
    \x20       except EndOfFile:\n\
    \x20           if path == word: raise\n\
    \x20   counts.append(count)\n\
    print(json.dumps(counts))\n";

/// How many messages of each topic PyPI's `mcap` finds in files, in its usual way; `None` where it is not installed. Of a file that ends in a part of a
/// chunk, as `torn:` before its name says, it is asked for those up to there.
pub fn counts_by_pypi(files: &[String]) -> Option<Vec<BTreeMap<String, usize>>> {
    Some(serde_json::from_slice(&run("mcap", "pip install mcap", COUNT, files)?).unwrap())
}

/// Runs a script on files; `None` where there is no Python that can import these modules.
pub fn run(modules: &str, hint: &str, script: &str, words: &[String]) -> Option<Vec<u8>> {
    let output = Command::new(python(modules, hint)?).args(["-c", script]).args(words).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(output.stdout)
}
