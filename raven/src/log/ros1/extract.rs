//! A few fields out of a ROS 1 message in one pass, without allocating.
//!
//! A definition and the wanted field paths compile to a list of steps once; walking a message then means skipping the rest and noting
//! where the wanted fields lie. Every length is checked against the message, so no bytes can make it panic.

use super::definition::{Count, Definition, Kind, Primitive};
use crate::log::Stamp;

/// Where messages have their header: the robot's own message calls it `hdr`.
pub const HEADER_STAMPS: [&str; 2] = ["header.stamp", "hdr.stamp"];

/// The stamp out of the values of [`HEADER_STAMPS`]; `None` if there is none or it is unset.
#[must_use]
pub fn header_stamp(values: [Option<Value<'_>>; 2]) -> Option<Stamp> {
    let [header, hdr] = values;
    header.or(hdr)?.stamp().filter(|stamp| stamp.0 > 0)
}

/// More fields than this, counted through nested types, are a malformed definition.
const MAX_FIELDS: usize = 10_000;
/// Types nested deeper than this are a definition that contains itself.
const MAX_DEPTH: usize = 32;

#[derive(Debug, Clone, PartialEq)]
enum Step {
    /// Bytes nobody wants.
    Skip(usize),
    /// A `uint32` count and as many values of this size.
    SkipCounted(usize),
    /// Strings nobody wants.
    SkipTexts(Count),
    /// A wanted field.
    Take { slot: usize, kind: Primitive, count: Count },
    /// Messages whose fields are of variable size.
    Repeat { count: Count, body: Vec<Step> },
}

/// Finds wanted fields in messages of one type.
#[derive(Debug, Clone)]
pub struct Extractor {
    steps: Vec<Step>,
    found: Vec<bool>,
}

/// Where a wanted field lies in a message, and what it is.
#[derive(Debug, Clone, Copy)]
pub struct Value<'m> {
    kind: Primitive,
    count: usize,
    bytes: &'m [u8],
}

impl Extractor {
    /// Compiles a definition for the wanted paths, as in `["header.stamp", "position"]`. A path that the definition does not have stays
    /// without a value; fields inside arrays of messages cannot be named.
    ///
    /// # Errors
    /// A sentence, if the type contains itself or is too large.
    pub fn new(definition: &Definition, wanted: &[&str]) -> Result<Self, String> {
        let mut compiler = Compiler { definition, wanted, found: vec![false; wanted.len()], fields: 0 };
        let mut steps = Vec::new();
        compiler.message(&definition.root, Some(""), 0, &mut steps)?;
        Ok(Self { steps, found: compiler.found })
    }

    /// Whether the definition has the wanted path with this index.
    #[must_use]
    pub fn has(&self, slot: usize) -> bool {
        self.found.get(slot).copied().unwrap_or(false)
    }

    /// Walks one message; `values[i]` becomes the i-th wanted field.
    ///
    /// # Errors
    /// If the message is shorter or longer than its definition says.
    pub fn walk<'m, const N: usize>(&self, message: &'m [u8]) -> Result<[Option<Value<'m>>; N], Misfit> {
        let mut values = [None; N];
        let mut cursor = Cursor { rest: message };
        cursor.run(&self.steps, &mut values)?;
        if cursor.rest.is_empty() { Ok(values) } else { Err(Misfit) }
    }
}

/// A message whose length does not fit its definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the message does not fit its definition")]
pub struct Misfit;

struct Compiler<'a> {
    definition: &'a Definition,
    wanted: &'a [&'a str],
    found: Vec<bool>,
    fields: usize,
}

impl Compiler<'_> {
    /// Steps over one message of type `name`. `path` is where it stands, `None` where its fields cannot be wanted.
    fn message(&mut self, name: &str, path: Option<&str>, depth: usize, steps: &mut Vec<Step>) -> Result<(), String> {
        if depth > MAX_DEPTH {
            return Err(format!("type `{name}` contains itself"));
        }
        let definition = self.definition;
        for field in definition.fields(name) {
            self.fields += 1;
            if self.fields > MAX_FIELDS {
                return Err(format!("more than {MAX_FIELDS} fields"));
            }
            let path = path.map(|outer| if outer.is_empty() { field.name.clone() } else { format!("{outer}.{}", field.name) });
            match &field.kind {
                Kind::Primitive(kind) => {
                    let slot = self.wanted.iter().position(|wanted| path.as_deref() == Some(*wanted));
                    if let Some(slot) = slot {
                        if let Some(found) = self.found.get_mut(slot) {
                            *found = true;
                        }
                        steps.push(Step::Take { slot, kind: *kind, count: field.count });
                    } else {
                        skip(*kind, field.count, &field.name, steps)?;
                    }
                }
                Kind::Message(used) if field.count == Count::Fixed(1) => self.message(used, path.as_deref(), depth + 1, steps)?,
                Kind::Message(used) => {
                    let mut body = Vec::new();
                    self.message(used, None, depth + 1, &mut body)?;
                    repeat(field.count, body, &field.name, steps)?;
                }
            }
        }
        Ok(())
    }
}

fn push_skip(bytes: usize, field: &str, steps: &mut Vec<Step>) -> Result<(), String> {
    if let Some(Step::Skip(before)) = steps.last_mut() {
        *before = before.checked_add(bytes).ok_or_else(|| format!("field `{field}` is too large"))?;
    } else if bytes > 0 {
        steps.push(Step::Skip(bytes));
    }
    Ok(())
}

fn skip(kind: Primitive, count: Count, field: &str, steps: &mut Vec<Step>) -> Result<(), String> {
    match (kind.size(), count) {
        (Some(size), Count::Fixed(number)) => {
            push_skip(size.checked_mul(number).ok_or_else(|| format!("field `{field}` is too large"))?, field, steps)?;
        }
        (Some(size), Count::Prefixed) => steps.push(Step::SkipCounted(size)),
        // No step may take nothing, or it could be repeated for ever.
        (None, Count::Fixed(0)) => {}
        (None, Count::Fixed(1)) => steps.push(Step::SkipCounted(1)),
        (None, count) => steps.push(Step::SkipTexts(count)),
    }
    Ok(())
}

fn repeat(count: Count, body: Vec<Step>, field: &str, steps: &mut Vec<Step>) -> Result<(), String> {
    match (body.as_slice(), count) {
        ([], Count::Prefixed) => push_skip(4, field, steps),
        ([], Count::Fixed(_)) | (_, Count::Fixed(0)) => Ok(()),
        ([Step::Skip(size)], Count::Prefixed) => {
            steps.push(Step::SkipCounted(*size));
            Ok(())
        }
        ([Step::Skip(size)], Count::Fixed(number)) => {
            push_skip(size.checked_mul(number).ok_or_else(|| format!("field `{field}` is too large"))?, field, steps)
        }
        _ => {
            steps.push(Step::Repeat { count, body });
            Ok(())
        }
    }
}

struct Cursor<'m> {
    rest: &'m [u8],
}

impl<'m> Cursor<'m> {
    fn take(&mut self, bytes: usize) -> Result<&'m [u8], Misfit> {
        let (taken, rest) = self.rest.split_at_checked(bytes).ok_or(Misfit)?;
        self.rest = rest;
        Ok(taken)
    }

    fn count(&mut self, count: Count) -> Result<usize, Misfit> {
        match count {
            Count::Fixed(number) => Ok(number),
            Count::Prefixed => {
                let (bytes, rest) = self.rest.split_first_chunk().ok_or(Misfit)?;
                self.rest = rest;
                usize::try_from(u32::from_le_bytes(*bytes)).map_err(|_| Misfit)
            }
        }
    }

    fn texts(&mut self, number: usize) -> Result<&'m [u8], Misfit> {
        let start = self.rest;
        for _ in 0..number {
            let length = self.count(Count::Prefixed)?;
            self.take(length)?;
        }
        start.get(..start.len() - self.rest.len()).ok_or(Misfit)
    }

    fn run<const N: usize>(&mut self, steps: &[Step], values: &mut [Option<Value<'m>>; N]) -> Result<(), Misfit> {
        for step in steps {
            match step {
                Step::Skip(bytes) => {
                    self.take(*bytes)?;
                }
                Step::SkipCounted(size) => {
                    let number = self.count(Count::Prefixed)?;
                    self.take(number.checked_mul(*size).ok_or(Misfit)?)?;
                }
                Step::SkipTexts(count) => {
                    let number = self.count(*count)?;
                    self.texts(number)?;
                }
                Step::Take { slot, kind, count } => {
                    let number = self.count(*count)?;
                    let bytes = match kind.size() {
                        Some(size) => self.take(number.checked_mul(size).ok_or(Misfit)?)?,
                        None => self.texts(number)?,
                    };
                    if let Some(value) = values.get_mut(*slot) {
                        *value = Some(Value { kind: *kind, count: number, bytes });
                    }
                }
                // A body is never empty and each of its steps takes at least a byte or stops, so the end of the message ends the loop.
                Step::Repeat { count, body } => {
                    for _ in 0..self.count(*count)? {
                        self.run(body, values)?;
                    }
                }
            }
        }
        Ok(())
    }
}

impl<'m> Value<'m> {
    /// Number of values: 1 for a plain field.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.count
    }

    /// Whether there are no values.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The bytes on the wire.
    #[must_use]
    pub const fn bytes(&self) -> &'m [u8] {
        self.bytes
    }

    /// The i-th number, `None` beyond the end or if the field holds no numbers.
    #[must_use]
    pub fn number(&self, i: usize) -> Option<f64> {
        Some(match self.kind {
            Primitive::F32 => f64::from(f32::from_le_bytes(self.at(i)?)),
            Primitive::F64 => f64::from_le_bytes(self.at(i)?),
            _ => self.integer(i)? as f64,
        })
    }

    /// The i-th integer, `None` beyond the end or if the field holds no integers.
    #[must_use]
    pub fn integer(&self, i: usize) -> Option<i64> {
        Some(match self.kind {
            Primitive::Bool | Primitive::U8 => i64::from(u8::from_le_bytes(self.at(i)?)),
            Primitive::I8 => i64::from(i8::from_le_bytes(self.at(i)?)),
            Primitive::I16 => i64::from(i16::from_le_bytes(self.at(i)?)),
            Primitive::U16 => i64::from(u16::from_le_bytes(self.at(i)?)),
            Primitive::I32 => i64::from(i32::from_le_bytes(self.at(i)?)),
            Primitive::U32 => i64::from(u32::from_le_bytes(self.at(i)?)),
            Primitive::I64 => i64::from_le_bytes(self.at(i)?),
            Primitive::U64 => i64::try_from(u64::from_le_bytes(self.at(i)?)).ok()?,
            Primitive::F32 | Primitive::F64 | Primitive::Time | Primitive::Duration | Primitive::Text => return None,
        })
    }

    /// The first `N` numbers, `None` if there are fewer.
    #[must_use]
    pub fn numbers<const N: usize>(&self) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = self.number(i)?;
        }
        Some(numbers)
    }

    /// The time, `None` if the field is not a `time`.
    #[must_use]
    pub fn stamp(&self) -> Option<Stamp> {
        let (Primitive::Time, Some((seconds, rest))) = (self.kind, self.bytes.split_first_chunk()) else { return None };
        Some(Stamp::from_ros(u32::from_le_bytes(*seconds), u32::from_le_bytes(*rest.first_chunk()?)))
    }

    /// The strings, with bytes that are no UTF-8 replaced; nothing if the field holds no strings.
    pub fn texts(&self) -> impl Iterator<Item = std::borrow::Cow<'m, str>> {
        let mut cursor = Cursor { rest: if self.kind == Primitive::Text { self.bytes } else { &[] } };
        std::iter::from_fn(move || {
            let length = cursor.count(Count::Prefixed).ok()?;
            cursor.take(length).ok().map(String::from_utf8_lossy)
        })
    }

    fn at<const SIZE: usize>(&self, i: usize) -> Option<[u8; SIZE]> {
        self.bytes.get(i.checked_mul(SIZE)?..)?.first_chunk().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_is_found_under_either_name_and_zero_is_none() {
        for field in ["header", "hdr"] {
            let definition = Definition::parse("p/Root", &format!("Header {field}\n")).unwrap();
            let extractor = Extractor::new(&definition, &HEADER_STAMPS).unwrap();
            let stamp = |seconds| header_stamp(extractor.walk(&[0, seconds, 0, 0].map(u32::to_le_bytes).concat()).unwrap());
            assert_eq!((stamp(3), stamp(0)), (Some(Stamp::from_ros(3, 0)), None));
        }
    }
}
