//! What others may send, right and wrong, without a network.

use std::io::{Cursor, Read, Write};

use proptest::collection::vec;
use proptest::prelude::*;

use super::*;

/// A publisher's header as roscpp sends it.
fn header() -> Vec<u8> {
    let definition = "Header hdr\nint32 runlevel\n";
    encode_header(&[
        ("callerid", "/r2_control"),
        ("latching", "0"),
        ("md5sum", "ce9e7f4969049d8bb365de3c98461a01"),
        ("message_definition", definition),
        ("topic", "/ravenstate"),
        ("type", "raven_2/raven_state"),
    ])
}

/// Both directions of a connection: what is written vanishes.
struct Peer<'a>(&'a [u8]);

impl Read for Peer<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(buffer)
    }
}

impl Write for Peer<'_> {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        Ok(buffer.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn sentence<T: std::fmt::Debug>(result: Result<T, ReadFault>) -> String {
    result.unwrap_err().of("the peer").to_string()
}

#[test]
fn a_publishers_header_is_kept() {
    let connection = Connection::open(&mut Peer(&header()), "/us", "/ravenstate").unwrap();
    assert_eq!(connection.message_type, "raven_2/raven_state");
    assert_eq!(connection.md5sum, "ce9e7f4969049d8bb365de3c98461a01");
    assert!(connection.definition.starts_with("Header hdr\n") && !connection.latching);
}

/// The bytes of a header as the wiki's TCPROS page spells them out.
#[test]
fn a_header_has_the_documented_bytes() {
    assert_eq!(encode_header(&[("topic", "/chatter")]), b"\x12\0\0\0\x0e\0\0\0topic=/chatter");
}

#[test]
fn what_is_wrong_with_a_connection_is_said() {
    let refused = encode_header(&[("error", "topic types do not match")]);
    let said = sentence(Connection::open(&mut Peer(&refused), "/us", "/t"));
    assert!(said.contains("topic types do not match"), "{said}");
    let without_sum = encode_header(&[("type", "std_msgs/String")]);
    assert!(sentence(Connection::open(&mut Peer(&without_sum), "/us", "/t")).contains("without `md5sum`"));
    let cut = &header()[..40];
    assert!(sentence(Connection::open(&mut Peer(cut), "/us", "/t")).starts_with("lost the peer"));
    let lying = [&20_u32.to_le_bytes()[..], &900_u32.to_le_bytes(), &[b'x'; 16]].concat();
    assert!(sentence(read_header(&mut lying.as_slice())).contains("ends 20 bytes into a field"));
}

/// Were the length believed, this would ask for 4 GB, and for 64 MB of which nothing comes.
#[test]
fn a_length_alone_allocates_nothing() {
    let said = sentence(read_block(&mut u32::MAX.to_le_bytes().as_slice(), MESSAGE_LIMIT, "a message"));
    assert!(said.contains("a message of 4294967295 bytes"), "{said}");
    assert!(sentence(read_block(&mut [0, 0, 0, 4, 1].as_slice(), MESSAGE_LIMIT, "a message")).starts_with("lost"));
    let http = "HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n";
    assert!(sentence(HttpMessage::read(&mut http.as_bytes())).contains("99999999999 bytes"));
}

#[test]
fn answers_as_rosmaster_writes_them() {
    let xml = "<?xml version='1.0'?>\n<methodResponse>\n<params>\n<param>\n<value><array><data>\n<value><int>1</int></value>\n\
               <value><string>Subscribed to [/a &amp; b]</string></value>\n<value><array><data>\n<value>http://robot:40123/</value>\n\
               </data></array></value>\n</data></array></value>\n</param>\n</params>\n</methodResponse>\n";
    let answer = read_answer(xml).unwrap().unwrap();
    let [code, words, publishers] = answer.list().unwrap() else { panic!("{answer:?}") };
    assert_eq!((code.integer(), words.text()), (Some(1), Some("Subscribed to [/a & b]")));
    assert_eq!(publishers.texts().unwrap(), ["http://robot:40123/"]);
    assert_eq!(read_answer(&write_answer(Err("no <such> method".to_owned()))).unwrap(), Err("no <such> method".to_owned()));
}

/// roscpp's library writes `i4`, leaves `<string>` out and separates by line ends and tabs; its head has `Content-length`.
#[test]
fn answers_as_roscpp_writes_them() {
    let body = "<?xml version=\"1.0\"?>\r\n<methodResponse><params><param>\r\n\t<value><array><data><value><i4>1</i4></value><value></value>\
                <value><array><data><value>TCPROS</value><value>robot</value><value><i4>40123</i4></value></data></array></value></data>\
                </array></value>\r\n</param></params></methodResponse>\r\n";
    let answer =
        format!("HTTP/1.1 200 OK\r\nServer: XMLRPC++ 0.7\r\nContent-Type: text/xml\r\nContent-length: {}\r\n\r\n{body}", body.len());
    let answer = read_answer(&HttpMessage::read(&mut answer.as_bytes()).unwrap().body).unwrap().unwrap();
    let [code, words, protocol] = answer.list().unwrap() else { panic!("{answer:?}") };
    assert_eq!((code.integer(), words.text()), (Some(1), Some("")));
    assert_eq!(protocol.list().unwrap()[2], Value::Integer(40123));
}

#[test]
fn xml_made_to_hurt_is_refused() {
    let deep = format!("<methodResponse><params><param>{}", "<value><array><data>".repeat(20_000));
    assert!(read_answer(&deep).is_err());
    let whole = format!(
        "<methodResponse><params><param>{}{}</param></params></methodResponse>",
        "<value><array><data>".repeat(40),
        "</data></array></value>".repeat(40)
    );
    assert!(read_answer(&whole).unwrap_err().contains("deep"));
    let bomb = "<!DOCTYPE x [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><methodResponse><params><param><value>&b;</value></param></params></methodResponse>";
    assert!(read_answer(bomb).is_err());
    for wrong in ["", "<", "<a/>", "<methodResponse/>", "<methodResponse><params/></methodResponse>"] {
        assert!(read_answer(wrong).is_err(), "{wrong}");
    }
    for value in
        ["<int>4294967296</int>", "<boolean>2</boolean>", "<double>x</double>", "<base64>AA==</base64>", "<struct><member/></struct>"]
    {
        let xml = format!("<methodResponse><params><param><value>{value}</value></param></params></methodResponse>");
        assert!(read_answer(&xml).is_err(), "{value}");
    }
}

fn values() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        any::<i32>().prop_map(Value::Integer),
        any::<bool>().prop_map(Value::Boolean),
        (-1e9..1e9_f64).prop_map(Value::Double),
        "[ -~é\n\t]{0,20}".prop_map(Value::Text),
    ];
    leaf.prop_recursive(4, 32, 4, |inner| {
        prop_oneof![vec(inner.clone(), 0..4).prop_map(Value::List), vec(("[a-z]{1,6}", inner), 0..3).prop_map(Value::Struct)]
    })
}

proptest! {
    #[test]
    fn calls_come_back_as_written(method in "[a-zA-Z]{1,12}", parameters in vec(values(), 0..4)) {
        prop_assert_eq!(read_call(&write_call(&method, &parameters)), Ok((method, parameters.clone())));
        for value in parameters {
            prop_assert_eq!(read_answer(&write_answer(Ok(value.clone()))), Ok(Ok(value)));
        }
    }

    #[test]
    fn damaged_calls_and_answers_never_panic(value in values(), cut in 0.0..=1.0_f64, flips in vec((any::<prop::sample::Index>(), any::<u8>()), 0..6)) {
        for xml in [write_answer(Ok(value.clone())), write_call("publisherUpdate", &[value])] {
            let mut bytes = HttpMessage::bytes("HTTP/1.1 200 OK", "", &xml);
            for (at, byte) in &flips {
                let at = at.index(bytes.len());
                bytes[at] = *byte;
            }
            bytes.truncate((cut * bytes.len() as f64) as usize);
            if let Ok(message) = HttpMessage::read(&mut bytes.as_slice()) {
                let _sentence = read_answer(&message.body);
                let _sentence = read_call(&message.body);
            }
            let _sentence = read_answer(&String::from_utf8_lossy(&bytes));
        }
    }

    #[test]
    fn damaged_streams_of_messages_never_panic(
        messages in vec(vec(any::<u8>(), 0..60), 0..6),
        cut in 0.0..=1.0_f64,
        flips in vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
    ) {
        let blocks = messages.iter().flat_map(|data| [&(data.len() as u32).to_le_bytes()[..], data].concat());
        let whole: Vec<u8> = header().into_iter().chain(blocks).collect();
        let mut bytes = whole.clone();
        for (at, byte) in &flips {
            let at = at.index(bytes.len());
            bytes[at] = *byte;
        }
        bytes.truncate((cut * bytes.len() as f64) as usize);
        let untouched = bytes == whole;
        let mut stream = Cursor::new(bytes);
        let mut read = Vec::new();
        if read_header(&mut stream).is_ok() {
            while let Ok(data) = read_block(&mut stream, MESSAGE_LIMIT, "a message") {
                read.push(data);
            }
        }
        if untouched {
            prop_assert_eq!(read, messages);
        }
    }
}
