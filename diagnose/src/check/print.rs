//! The score as people read it.

use std::fmt;

use super::metrics::Share;
use super::score::Score;

impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} recordings, {} without a verdict", self.recordings, self.failed)?;
        let shares = [
            ("single effects, first answer right", self.top1),
            ("  of those that the recording can show", self.top1_shown),
            ("single effects, right among the first two", self.top2),
            ("single effects, exactly right", self.single_exact),
            ("false alarms where there is nothing", self.false_alarms),
            ("pairs exactly right", self.pairs_exact),
            ("  of those whose every effect can show", self.pairs_shown),
            ("causes outside the library noticed", self.outside_recall),
            ("sizes within one stated deviation", self.sizes.within_one_std),
            ("sizes within their 95 % interval", self.sizes.within_95),
        ];
        for (what, share) in shares {
            writeln!(f, "{what:<44} {}", text(share))?;
        }
        let percent = |value: f64| format!("{:.1} %", 100.0 * value);
        let numbers = [
            ("error of the size, median", self.sizes.median_relative_error.map(percent)),
            ("gap closed, of what closes when told", self.gap_closed_of_oracle.map(percent)),
            ("  with the file's numbers retuned as well", self.gap_closed_of_oracle_retuned.map(percent)),
            ("expected calibration error", self.ece.map(|ece| format!("{ece:.3}"))),
            ("Brier score", self.brier.map(|brier| format!("{brier:.3}"))),
            ("time per recording, mean", self.seconds_mean.map(|seconds| format!("{seconds:.1} s"))),
            (
                "time per recording, longest",
                self.seconds_longest.zip(self.slowest.as_ref()).map(|(seconds, name)| format!("{seconds:.1} s, {name}")),
            ),
        ];
        for (what, number) in numbers {
            writeln!(f, "{what:<44} {}", number.unwrap_or_else(|| "-".to_owned()))?;
        }
        if !self.confusion.is_empty() {
            writeln!(f, "\nWhat is true, and the first answer")?;
        }
        for (truth, answers) in &self.confusion {
            let answers: Vec<String> = answers.iter().map(|(answer, count)| format!("{answer} {count}")).collect();
            writeln!(f, "{truth:<28} {}", answers.join(", "))?;
        }
        if !self.wrong.is_empty() {
            writeln!(f, "\nWrong: recording, what is true and the evidence for it when told, what was said")?;
        }
        for [name, truth, said] in &self.wrong {
            writeln!(f, "{name:<14} {truth:<60} {said}")?;
        }
        Ok(())
    }
}

/// Hits, share and interval.
fn text(share: Share) -> String {
    match (share.value(), share.wilson95()) {
        (Some(value), Some([low, high])) => {
            format!("{:>4} of {:<4} {:5.1} %  [{:.1}, {:.1}]", share.hits, share.of, 100.0 * value, 100.0 * low, 100.0 * high)
        }
        _ => "-".to_owned(),
    }
}
