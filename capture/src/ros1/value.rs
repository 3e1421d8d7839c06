//! Values of XML-RPC (xmlrpc.com/spec.md) as far as ROS 1's graph of nodes uses them, and calls and answers made of them.

use std::fmt::Write;

use roxmltree::{Document, Node, ParsingOptions};

/// Arrays in arrays deeper than this are no answer of a ROS node, whose deepest has four.
const MAX_DEPTH: usize = 16;
/// More XML nodes than this are no answer of a ROS node.
const MAX_NODES: u32 = 100_000;

/// One value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `int` or `i4`.
    Integer(i32),
    /// `boolean`.
    Boolean(bool),
    /// `double`.
    Double(f64),
    /// `string`.
    Text(String),
    /// `array`.
    List(Vec<Value>),
    /// `struct`.
    Struct(Vec<(String, Value)>),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl Value {
    /// The triple that every method of ROS answers with: 1 for success, words, and the value.
    #[must_use]
    pub fn success(words: &str, value: Self) -> Self {
        Self::List(vec![Self::Integer(1), words.into(), value])
    }

    /// The triple of a method that failed.
    #[must_use]
    pub fn failure(words: &str) -> Self {
        Self::List(vec![Self::Integer(-1), words.into(), Self::Integer(0)])
    }

    /// The text, if it is one.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    /// The integer, if it is one.
    #[must_use]
    pub const fn integer(&self) -> Option<i32> {
        if let Self::Integer(number) = self { Some(*number) } else { None }
    }

    /// The items, if it is a list.
    #[must_use]
    pub fn list(&self) -> Option<&[Self]> {
        if let Self::List(items) = self { Some(items) } else { None }
    }

    /// The texts of a list of texts.
    #[must_use]
    pub fn texts(&self) -> Option<Vec<String>> {
        self.list()?.iter().map(|item| item.text().map(str::to_owned)).collect()
    }

    fn write(&self, xml: &mut String) {
        // Writing to a string cannot fail.
        let _ = match self {
            Self::Integer(number) => write!(xml, "<value><int>{number}</int></value>"),
            Self::Boolean(truth) => write!(xml, "<value><boolean>{}</boolean></value>", u8::from(*truth)),
            Self::Double(number) => write!(xml, "<value><double>{number}</double></value>"),
            Self::Text(text) => write!(xml, "<value><string>{}</string></value>", escaped(text)),
            Self::List(items) => {
                xml.push_str("<value><array><data>");
                items.iter().for_each(|item| item.write(xml));
                write!(xml, "</data></array></value>")
            }
            Self::Struct(members) => {
                xml.push_str("<value><struct>");
                for (name, value) in members {
                    let _ = write!(xml, "<member><name>{}</name>", escaped(name));
                    value.write(xml);
                    xml.push_str("</member>");
                }
                write!(xml, "</struct></value>")
            }
        };
    }

    fn read(value: Node<'_, '_>, depth: usize) -> Result<Self, String> {
        if depth > MAX_DEPTH {
            return Err(format!("values in values more than {MAX_DEPTH} deep"));
        }
        let Some(typed) = value.first_element_child() else {
            return Ok(Self::Text(text_of(value)));
        };
        let text = text_of(typed);
        let wrong = || format!("`{text}` as <{}>", typed.tag_name().name());
        match typed.tag_name().name() {
            "int" | "i4" => text.trim().parse().map(Self::Integer).map_err(|_| wrong()),
            "boolean" => match text.trim() {
                "0" => Ok(Self::Boolean(false)),
                "1" => Ok(Self::Boolean(true)),
                _ => Err(wrong()),
            },
            "double" => text.trim().parse().map(Self::Double).map_err(|_| wrong()),
            "string" => Ok(Self::Text(text)),
            "array" => {
                let data = child(typed, "data")?;
                let items = data.children().filter(Node::is_element).map(|item| Self::read(named(item, "value")?, depth + 1));
                items.collect::<Result<_, _>>().map(Self::List)
            }
            "struct" => {
                let member = |member: Node<'_, '_>| {
                    Ok((text_of(child(named(member, "member")?, "name")?), Self::read(child(member, "value")?, depth + 1)?))
                };
                typed.children().filter(Node::is_element).map(member).collect::<Result<_, String>>().map(Self::Struct)
            }
            other => Err(format!("a value of type <{other}>, which ROS does not use")),
        }
    }
}

/// The XML of a call.
#[must_use]
pub fn write_call(method: &str, parameters: &[Value]) -> String {
    let mut xml = format!("<?xml version=\"1.0\"?>\n<methodCall><methodName>{}</methodName><params>", escaped(method));
    write_parameters(&mut xml, parameters);
    xml.push_str("</params></methodCall>\n");
    xml
}

/// The XML of an answer, or of the refusal to give one.
#[must_use]
pub fn write_answer(answer: Result<Value, String>) -> String {
    let mut xml = "<?xml version=\"1.0\"?>\n<methodResponse>".to_owned();
    match answer {
        Ok(value) => {
            xml.push_str("<params>");
            write_parameters(&mut xml, &[value]);
            xml.push_str("</params>");
        }
        Err(why) => {
            xml.push_str("<fault>");
            Value::Struct(vec![("faultCode".to_owned(), Value::Integer(1)), ("faultString".to_owned(), Value::Text(why))]).write(&mut xml);
            xml.push_str("</fault>");
        }
    }
    xml.push_str("</methodResponse>\n");
    xml
}

/// Method and parameters of a call.
///
/// # Errors
/// Half a sentence about what is wrong with it.
pub fn read_call(xml: &str) -> Result<(String, Vec<Value>), String> {
    let document = parse(xml)?;
    let call = named(document.root_element(), "methodCall")?;
    let method = text_of(child(call, "methodName")?).trim().to_owned();
    // A call without parameters may leave them out.
    let parameters = child(call, "params").map_or_else(|_| Ok(Vec::new()), read_parameters)?;
    Ok((method, parameters))
}

/// The value of an answer, or the words of the refusal.
///
/// # Errors
/// Half a sentence about what is wrong with it.
pub fn read_answer(xml: &str) -> Result<Result<Value, String>, String> {
    let document = parse(xml)?;
    let answer = named(document.root_element(), "methodResponse")?;
    if let Ok(fault) = child(answer, "fault") {
        let Value::Struct(members) = Value::read(child(fault, "value")?, 0)? else { return Err("a fault without words".to_owned()) };
        let words = members.into_iter().find(|(name, _)| name == "faultString").and_then(|(_, value)| value.text().map(str::to_owned));
        return Ok(Err(words.unwrap_or_else(|| "without words".to_owned())));
    }
    let mut parameters = read_parameters(child(answer, "params")?)?.into_iter();
    match (parameters.next(), parameters.next()) {
        (Some(value), None) => Ok(Ok(value)),
        _ => Err("an answer that is not one value".to_owned()),
    }
}

fn write_parameters(xml: &mut String, parameters: &[Value]) {
    for parameter in parameters {
        xml.push_str("<param>");
        parameter.write(xml);
        xml.push_str("</param>");
    }
}

fn read_parameters(parameters: Node<'_, '_>) -> Result<Vec<Value>, String> {
    parameters.children().filter(Node::is_element).map(|one| Value::read(child(named(one, "param")?, "value")?, 0)).collect()
}

fn parse(xml: &str) -> Result<Document<'_>, String> {
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(xml, options).map_err(|fault| format!("XML that cannot be read ({fault})"))
}

fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, String> {
    let found = node.children().find(|child| child.tag_name().name() == name);
    found.ok_or_else(|| format!("<{}> without <{name}>", node.tag_name().name()))
}

fn named<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, String> {
    let found = node.tag_name().name();
    if found == name { Ok(node) } else { Err(format!("<{found}> where <{name}> belongs")) }
}

fn text_of(node: Node<'_, '_>) -> String {
    node.children().filter_map(|child| if child.is_text() { child.text() } else { None }).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('\r', "&#13;")
}
