//! Message definitions as ROS 1 stores them: the text of a message type followed by those of all types it uses.
//!
//! One field per line, `type name`, `type[] name` or `type[N] name`; constants are `type NAME=value`; `#` starts a comment. The types used
//! follow, each after a line of `=` and a line `MSG: package/Type` (the output of `gendeps --cat`, which bags and MCAP files carry).

use std::collections::BTreeMap;

/// Types the wire format knows by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Primitive {
    /// `bool`, one byte.
    Bool,
    /// `int8` or `byte`.
    I8,
    /// `uint8` or `char`.
    U8,
    /// `int16`.
    I16,
    /// `uint16`.
    U16,
    /// `int32`.
    I32,
    /// `uint32`.
    U32,
    /// `int64`.
    I64,
    /// `uint64`.
    U64,
    /// `float32`.
    F32,
    /// `float64`.
    F64,
    /// `time`: two `uint32`.
    Time,
    /// `duration`: two `int32`.
    Duration,
    /// `string`: a `uint32` length, then bytes.
    Text,
}

impl Primitive {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "int8" | "byte" => Self::I8,
            "uint8" | "char" => Self::U8,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            "time" => Self::Time,
            "duration" => Self::Duration,
            "string" => Self::Text,
            _ => return None,
        })
    }

    /// Bytes of one value, `None` for strings.
    #[must_use]
    pub const fn size(self) -> Option<usize> {
        Some(match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 | Self::Time | Self::Duration => 8,
            Self::Text => return None,
        })
    }
}

/// What a field holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// A type of the wire format.
    Primitive(Primitive),
    /// Another message, by its full name `package/Type`.
    Message(String),
}

/// How many values a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Count {
    /// That many, without a length on the wire: 1 for a plain field.
    Fixed(usize),
    /// As many as the `uint32` before them says.
    Prefixed,
}

/// One field of a message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Name as written.
    pub name: String,
    /// Type as written, with its brackets.
    pub written_type: String,
    /// What one value is.
    pub kind: Kind,
    /// How many values there are.
    pub count: Count,
}

/// A message type: its fields, and its constants as `type NAME=value`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MessageType {
    /// Fields in wire order.
    pub fields: Vec<Field>,
    /// Constants as `type NAME=value`; they are not on the wire.
    pub constants: Vec<String>,
}

/// A message type and all types it uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// Full name of the outermost type.
    pub root: String,
    /// Every type by its full name.
    pub types: BTreeMap<String, MessageType>,
}

const HEADER: &str = "std_msgs/Header";
const HEADER_TEXT: &str = "uint32 seq\ntime stamp\nstring frame_id\n";

impl Definition {
    /// Parses the definition text of message type `root`, as in `sensor_msgs/JointState`.
    ///
    /// # Errors
    /// A sentence with the line, if a line is no field, or the name of a type that is used but not defined.
    pub fn parse(root: &str, text: &str) -> Result<Self, String> {
        let mut types = BTreeMap::new();
        let mut name = root.to_owned();
        let mut lines = text.lines().peekable();
        loop {
            let mut message = MessageType::default();
            let mut next = None;
            while let Some(line) = lines.next() {
                if is_separator(line) {
                    let title = lines.next().unwrap_or_default().trim();
                    let title = title.strip_prefix("MSG:").ok_or_else(|| format!("`MSG: package/Type` expected, `{title}` found"))?;
                    next = Some(title.trim().to_owned());
                    break;
                }
                parse_line(line, &name, &mut message)?;
            }
            types.insert(name, message);
            match next {
                Some(title) => name = title,
                None => break,
            }
        }
        let mut definition = Self { root: root.to_owned(), types };
        definition.resolve()?;
        Ok(definition)
    }

    /// Fields of a type.
    #[must_use]
    pub fn fields(&self, name: &str) -> &[Field] {
        self.types.get(name).map_or(&[], |message| &message.fields)
    }

    /// Makes every used type's name a key of `types`. A definition cut off after its first type still knows `Header`.
    fn resolve(&mut self) -> Result<(), String> {
        let uses_header = |message: &MessageType| message.fields.iter().any(|field| field.kind == Kind::Message(HEADER.to_owned()));
        if !self.types.contains_key(HEADER) && self.types.values().any(uses_header) {
            let mut header = MessageType::default();
            for line in HEADER_TEXT.lines() {
                parse_line(line, HEADER, &mut header)?;
            }
            self.types.insert(HEADER.to_owned(), header);
        }
        for (name, message) in &self.types {
            for field in &message.fields {
                if let Kind::Message(used) = &field.kind
                    && !self.types.contains_key(used)
                {
                    return Err(format!("type `{used}` of field `{}` in `{name}` is not defined", field.name));
                }
            }
        }
        Ok(())
    }
}

fn is_separator(line: &str) -> bool {
    let line = line.trim();
    line.len() >= 3 && line.bytes().all(|byte| byte == b'=')
}

fn parse_line(line: &str, owner: &str, message: &mut MessageType) -> Result<(), String> {
    let code = line.split('#').next().unwrap_or_default().trim();
    if code.is_empty() {
        return Ok(());
    }
    let bad = || format!("`{}` in `{owner}` is no field", line.trim());
    let (written_type, rest) = code.split_once(char::is_whitespace).ok_or_else(bad)?;
    let rest = rest.trim();
    if rest.contains('=') {
        // The value of a string constant runs to the end of the line: `#` is part of it.
        let whole = line.trim().split_once(char::is_whitespace).map_or(rest, |(_, whole)| whole);
        let (name, value) = (if written_type == "string" { whole } else { rest }).split_once('=').ok_or_else(bad)?;
        message.constants.push(format!("{written_type} {}={}", name.trim(), value.trim()));
        return Ok(());
    }
    if rest.contains(char::is_whitespace) {
        return Err(bad());
    }
    let (base, count) = match written_type.strip_suffix(']').and_then(|t| t.split_once('[')) {
        Some((base, "")) => (base, Count::Prefixed),
        Some((base, number)) => (base, Count::Fixed(number.parse().map_err(|_| bad())?)),
        None => (written_type, Count::Fixed(1)),
    };
    let kind = Primitive::named(base).map_or_else(|| Kind::Message(full_name(base, owner)), Kind::Primitive);
    message.fields.push(Field { name: rest.to_owned(), written_type: written_type.to_owned(), kind, count });
    Ok(())
}

/// `Header` is `std_msgs/Header` everywhere; another bare name is of the package that uses it.
fn full_name(name: &str, owner: &str) -> String {
    match (name, owner.split_once('/')) {
        ("Header", _) => HEADER.to_owned(),
        (name, Some((package, _))) if !name.contains('/') => format!("{package}/{name}"),
        _ => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn nested_types_constants_and_comments() {
        let text = "# a comment\nHeader header\nuint8 SEEN=0 # first\nstring MOTTO=a # b\nArm[] arms # two\n\nfloat32[3] x\n\
                    ================\nMSG: lab/Arm\nint16[] counts\nstd_msgs/Header stamp\n";
        let definition = Definition::parse("lab/State", text).unwrap();
        let root = &definition.types["lab/State"];
        assert_eq!(root.constants, ["uint8 SEEN=0", "string MOTTO=a # b"]);
        assert_eq!(root.fields.iter().map(|f| f.name.as_str()).collect::<Vec<_>>(), ["header", "arms", "x"]);
        assert_eq!(root.fields[1].kind, Kind::Message("lab/Arm".into()));
        assert_eq!(root.fields[2].count, Count::Fixed(3));
        assert_eq!(definition.fields("std_msgs/Header").len(), 3);
    }

    #[test]
    fn faults_are_named() {
        assert!(Definition::parse("lab/State", "Arm arm\n").unwrap_err().contains("`lab/Arm` of field `arm`"));
        assert!(Definition::parse("lab/State", "float64\n").unwrap_err().contains("`float64` in `lab/State`"));
        assert!(Definition::parse("lab/State", "int8[x] a\n").is_err());
        assert!(Definition::parse("lab/State", "int8 a\n===\nint8 b\n").unwrap_err().contains("MSG:"));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(?s).{0,200}") {
            let _ = Definition::parse("lab/State", &text);
        }

        #[test]
        fn nearly_right_text_does_not_panic(text in r"((int8|string|Header|A|b/A)(\[[0-9]{0,30}\]?)?[ =#\n]{0,2}[a-z\n]{0,3}|={3}\nMSG: (A|b/A)\n){0,20}") {
            let _ = Definition::parse("b/Root", &text);
        }
    }
}
