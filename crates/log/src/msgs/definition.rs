//! Messages of types that are not part of this crate, read with the help of the definition that
//! comes with them in the log.
//!
//! A definition is text, in the language of ROS 1 or ROS 2: the fields of the type, then for each
//! contained type a line of `=` and its fields. Only simple definitions are supported: numbers,
//! strings, lists and types composed of these.

use std::collections::BTreeMap;

use super::ROS1_MARK;

/// Types of a definition, by name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Definition {
    types: BTreeMap<String, Vec<Field>>,
    root: String,
}

#[derive(Clone, Debug, PartialEq)]
struct Field {
    name: String,
    kind: Kind,
    many: Many,
}

/// Number of values of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Many {
    One,
    Fixed(usize),
    List,
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Number(Primitive),
    Text,
    /// Two numbers of 32 bits, as in ROS 1.
    Time,
    Type(String),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Primitive {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

/// Value of a message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    /// Number of any type; a bool becomes 0 or 1.
    Number(f64),
    Text(String),
    List(Vec<Value>),
    /// Fields by name.
    Fields(BTreeMap<String, Value>),
    /// List of bytes, which is skipped.
    Bytes,
}

/// Maximum nesting of types.
const MOST_DEEP: usize = 16;
/// Maximum number of fields of all types of a definition.
const MOST_FIELDS: usize = 4096;
/// Maximum number of values of a message.
const MOST_VALUES: usize = 1 << 18;

/// Types that recorders leave out, because every log would contain them.
const WELL_KNOWN: [(&str, &str); 3] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id"),
];

impl Definition {
    /// Reads the definition of a type, whose name is written as in the log (`package/msg/Name`).
    ///
    /// # Errors
    /// A line that is not supported, or a type that is missing.
    pub(crate) fn parse(name: &str, text: &str) -> Result<Self, String> {
        let root = short_name(name);
        let mut types: BTreeMap<String, Vec<Field>> = BTreeMap::new();
        let mut of = (root.clone(), Vec::new());
        let mut count = 0;
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if line.starts_with("====") || line.is_empty() {
                continue;
            }
            if let Some(next) = line.strip_prefix("MSG:") {
                let (name, fields) = std::mem::replace(&mut of, (short_name(next), Vec::new()));
                types.entry(name).or_insert(fields);
                continue;
            }
            count += 1;
            if count > MOST_FIELDS {
                return Err(format!("more than {MOST_FIELDS} fields"));
            }
            of.1.extend(field(line)?);
        }
        types.entry(of.0).or_insert(of.1);
        let mut found = Self { types, root };
        for (name, text) in WELL_KNOWN {
            if !found.types.contains_key(name) {
                let fields = text.lines().filter_map(|line| field(line).ok().flatten());
                found.types.insert(name.to_owned(), fields.collect());
            }
        }
        found.resolve()?;
        Ok(found)
    }

    /// Gives each field that has a message type its full name.
    fn resolve(&mut self) -> Result<(), String> {
        let names: Vec<String> = self.types.keys().cloned().collect();
        for (owner, fields) in &mut self.types {
            let package = owner.split('/').next().unwrap_or_default();
            for field in fields {
                let Kind::Type(name) = &mut field.kind else { continue };
                let near = format!("{package}/{name}");
                let found = names.iter().find(|known| *known == name || **known == near);
                let found = found
                    .or_else(|| names.iter().find(|known| known.ends_with(&format!("/{name}"))));
                *name = found.ok_or_else(|| format!("no definition of `{name}`"))?.clone();
            }
        }
        Ok(())
    }

    /// Reads a message with its encapsulation header.
    ///
    /// # Errors
    /// A message that does not have this layout. Bytes after it are an error as well, because then
    /// the layout is a different one; up to seven are accepted as padding.
    pub(crate) fn read(&self, message: &[u8]) -> Result<Value, String> {
        let (header, body) = message.split_at_checked(4).ok_or("it ends early")?;
        let order = match header {
            _ if header == ROS1_MARK => Order::Ros1,
            [0, 0, ..] => Order::Big,
            [0, 1, ..] => Order::Little,
            _ => return Err("it is no CDR message".into()),
        };
        let mut reader = Reader { body, at: 0, order, left: MOST_VALUES };
        let value = self.value(&Kind::Type(self.root.clone()), &mut reader, 0)?;
        match body.len() - reader.at {
            0..8 => Ok(value),
            rest => Err(format!("{rest} bytes are left behind its fields")),
        }
    }

    fn value(&self, kind: &Kind, reader: &mut Reader<'_>, deep: usize) -> Result<Value, String> {
        reader.left = reader.left.checked_sub(1).ok_or("too many values")?;
        match kind {
            Kind::Number(primitive) => reader.number(*primitive).map(Value::Number),
            Kind::Text => reader.text().map(Value::Text),
            Kind::Time => {
                let both = [("sec", Primitive::I32), ("nanosec", Primitive::U32)];
                let mut fields = BTreeMap::new();
                for (name, primitive) in both {
                    fields.insert(name.to_owned(), Value::Number(reader.number(primitive)?));
                }
                Ok(Value::Fields(fields))
            }
            Kind::Type(_) if deep >= MOST_DEEP => Err("types within types without end".into()),
            Kind::Type(name) => {
                let fields = self.types.get(name).ok_or_else(|| format!("no type `{name}`"))?;
                if fields.is_empty() && reader.order != Order::Ros1 {
                    // In ROS 2, a type without fields takes one byte.
                    reader.take(1)?;
                }
                let mut values = BTreeMap::new();
                for field in fields {
                    values.insert(field.name.clone(), self.field(field, reader, deep)?);
                }
                Ok(Value::Fields(values))
            }
        }
    }

    fn field(&self, field: &Field, reader: &mut Reader<'_>, deep: usize) -> Result<Value, String> {
        let count = match field.many {
            Many::One => return self.value(&field.kind, reader, deep + 1),
            Many::Fixed(count) => count,
            Many::List => reader.length()?,
        };
        if field.kind == Kind::Number(Primitive::U8) {
            reader.take(count)?;
            return Ok(Value::Bytes);
        }
        let mut values = Vec::new();
        for _ in 0..count {
            values.push(self.value(&field.kind, reader, deep + 1)?);
        }
        Ok(Value::List(values))
    }
}

impl Value {
    /// Returns a field by its path, with dots between the names.
    pub(crate) fn get(&self, path: &str) -> Option<&Self> {
        path.split('.').try_fold(self, |value, name| match value {
            Self::Fields(fields) => fields.get(name),
            _ => None,
        })
    }

    /// Returns the first of several fields that exists.
    pub(crate) fn any(&self, paths: &[&str]) -> Option<&Self> {
        paths.iter().find_map(|path| self.get(path))
    }

    pub(crate) fn number(&self, paths: &[&str]) -> Option<f64> {
        match self.any(paths)? {
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// Returns a string field, or a number as a string.
    pub(crate) fn text(&self, paths: &[&str]) -> Option<String> {
        match self.any(paths)? {
            Self::Text(text) => Some(text.clone()),
            Self::Number(number) => Some(number.to_string()),
            _ => None,
        }
    }

    /// Returns the elements of a list; empty if there is no such list.
    pub(crate) fn list(&self, path: &str) -> &[Self] {
        match self.get(path) {
            Some(Self::List(values)) => values,
            _ => &[],
        }
    }
}

/// Returns a name without the middle part: `package/Name`.
fn short_name(name: &str) -> String {
    let name = name.trim();
    match (name.split('/').next(), name.rsplit_once('/')) {
        (Some(package), Some((_, last))) => format!("{package}/{last}"),
        _ => name.to_owned(),
    }
}

/// Reads a line; `None` for a constant.
fn field(line: &str) -> Result<Option<Field>, String> {
    let mut words = line.split_whitespace();
    let (Some(kind), Some(name)) = (words.next(), words.next()) else {
        return Err(format!("`{line}` is no field"));
    };
    // `uint8 X=1` and `uint8 X = 1`; anything else after a name is a default value.
    if name.contains('=') || words.next().is_some_and(|word| word.starts_with('=')) {
        return Ok(None);
    }
    let (kind, many) = match kind.split_once('[') {
        None => (kind, Many::One),
        Some((kind, count)) => {
            let count = count.trim_end_matches(']');
            let many = match count.parse() {
                Ok(count) => Many::Fixed(count),
                // Empty, or `<=` and an upper bound.
                Err(_) => Many::List,
            };
            (kind, many)
        }
    };
    let kind = match kind {
        "bool" | "uint8" | "byte" | "octet" | "char" => Kind::Number(Primitive::U8),
        "int8" => Kind::Number(Primitive::I8),
        "uint16" => Kind::Number(Primitive::U16),
        "int16" => Kind::Number(Primitive::I16),
        "uint32" => Kind::Number(Primitive::U32),
        "int32" => Kind::Number(Primitive::I32),
        "uint64" => Kind::Number(Primitive::U64),
        "int64" => Kind::Number(Primitive::I64),
        "float32" => Kind::Number(Primitive::F32),
        "float64" => Kind::Number(Primitive::F64),
        "time" | "duration" => Kind::Time,
        text if text == "string" || text.starts_with("string<=") => Kind::Text,
        text if text.starts_with("wstring") => return Err("wide strings are not read".into()),
        name => Kind::Type(short_name(name)),
    };
    Ok(Some(Field { name: name.to_owned(), kind, many }))
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Order {
    Ros1,
    Little,
    Big,
}

/// Reader of the bytes behind the encapsulation header.
struct Reader<'a> {
    body: &'a [u8],
    at: usize,
    order: Order,
    /// Number of values that may still be read.
    left: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count).ok_or("it ends early")?;
        let taken = self.body.get(self.at..end).ok_or("it ends early")?;
        self.at = end;
        Ok(taken)
    }

    fn number(&mut self, primitive: Primitive) -> Result<f64, String> {
        let size = match primitive {
            Primitive::U8 | Primitive::I8 => 1,
            Primitive::U16 | Primitive::I16 => 2,
            Primitive::U32 | Primitive::I32 | Primitive::F32 => 4,
            Primitive::U64 | Primitive::I64 | Primitive::F64 => 8,
        };
        if self.order != Order::Ros1 {
            // CDR aligns each number to its size.
            self.take((size - self.at % size) % size)?;
        }
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(self.take(size)?);
        if self.order == Order::Big {
            bytes[..size].reverse();
        }
        let word = u64::from_le_bytes(bytes);
        Ok(match primitive {
            Primitive::U8 | Primitive::U16 | Primitive::U32 | Primitive::U64 => word as f64,
            Primitive::I8 => f64::from(word as u8 as i8),
            Primitive::I16 => f64::from(word as u16 as i16),
            Primitive::I32 => f64::from(word as u32 as i32),
            Primitive::I64 => word as i64 as f64,
            Primitive::F32 => f64::from(f32::from_bits(word as u32)),
            Primitive::F64 => f64::from_bits(word),
        })
    }

    fn length(&mut self) -> Result<usize, String> {
        Ok(self.number(Primitive::U32)? as usize)
    }

    fn text(&mut self) -> Result<String, String> {
        let length = self.length()?;
        let bytes = self.take(length)?;
        // CDR includes a terminating zero in the length.
        let bytes = if self.order == Order::Ros1 {
            bytes
        } else {
            bytes.strip_suffix(&[0]).unwrap_or(bytes)
        };
        let text = std::str::from_utf8(bytes).map_err(|_| "a text that is none")?;
        Ok(text.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msgs::{Detection2DArray, Header, Message, Odometry, encode, encode_big_endian};
    use tagalong_core::Stamp;
    use tagalong_math::RandomSource;

    #[test]
    fn what_serde_writes_is_read_by_the_definition_in_either_byte_order() {
        let header = Header::new(Stamp::from_nanos(7_000_000_005), "odom");
        let mut odometry = Odometry { header, ..Odometry::default() };
        odometry.pose.pose.position.y = -2.5;
        odometry.child_frame_id = "base".into();
        let definition = Definition::parse(Odometry::TYPE, Odometry::DEFINITION).unwrap();
        for message in [encode(&odometry), encode_big_endian(&odometry)] {
            let value = definition.read(&message).unwrap();
            assert_eq!(value.number(&["pose.pose.position.y"]), Some(-2.5));
            assert_eq!(value.number(&["header.stamp.nanosec"]), Some(5.0));
            assert_eq!(value.text(&["child_frame_id"]).unwrap(), "base");
            for end in 0..message.len() - 8 {
                assert!(definition.read(&message[..end]).is_err(), "{end}");
            }
        }
    }

    #[test]
    fn constants_bounds_defaults_and_ros_1_times_are_understood() {
        let text = "uint8 KIND=3\nstring NAME = hello # none\nstring<=8 label\nfloat32[2] pair\n\
                    int64[<=4] ids 1\ntime at\nInner inner\n====\nMSG: my/Inner\nbool is\n";
        let definition = Definition::parse("my/msg/Outer", text).unwrap();
        let mut message = ROS1_MARK.to_vec();
        message.extend(2_u32.to_le_bytes());
        message.extend(b"ab");
        message.extend([1.5_f32, -1.0].iter().flat_map(|v| v.to_le_bytes()));
        message.extend(1_u32.to_le_bytes());
        message.extend((-9_i64).to_le_bytes());
        message.extend([4_u32, 5].iter().flat_map(|v| v.to_le_bytes()));
        message.push(1);
        let value = definition.read(&message).unwrap();
        assert_eq!(value.text(&["label"]).unwrap(), "ab");
        assert_eq!(value.list("ids"), [Value::Number(-9.0)]);
        assert_eq!(value.number(&["nowhere", "at.nanosec"]), Some(5.0));
        assert_eq!(value.number(&["inner.is"]), Some(1.0));
    }

    #[test]
    fn what_is_missing_or_endless_is_an_error() {
        assert!(Definition::parse("a/B", "Nowhere x").unwrap_err().contains("`Nowhere`"));
        assert!(Definition::parse("a/B", "just").is_err());
        let endless = Definition::parse("a/B", "B inner").unwrap();
        assert!(endless.read(&[0, 1, 0, 0, 0, 0, 0, 0]).unwrap_err().contains("without end"));
        let many = Definition::parse("a/B", "B2[] all\n====\nMSG: a/B2\n").unwrap();
        assert!(many.read(&[0, 1, 0, 0, 255, 255, 255, 255]).is_err());
        let text = Detection2DArray::DEFINITION;
        let boxes = Definition::parse(Detection2DArray::TYPE, text).unwrap();
        let mut message = encode(&Detection2DArray::default());
        assert!(boxes.read(&message).is_ok());
        message.extend([0; 9]);
        assert!(boxes.read(&message).unwrap_err().contains("9 bytes are left"), "another layout");
    }

    /// Number of mutated definitions and messages; a longer search sets the variable.
    fn trials() -> u64 {
        let set = std::env::var("TAGALONG_MUTATIONS").ok();
        set.and_then(|count| count.parse().ok()).unwrap_or(5_000)
    }

    #[test]
    fn mutated_definitions_and_messages_end_in_a_value_or_an_error() {
        let message = encode(&Detection2DArray::default());
        let text = Detection2DArray::DEFINITION.as_bytes();
        let mut random = tagalong_math::XorShift64::new(7);
        let mut read = 0_u64;
        for _ in 0..trials() {
            let mut text = text.to_vec();
            let mut message = message.clone();
            message.extend([1, 0, 0, 0, 0, 0, 0, 0]);
            for bytes in [&mut text, &mut message] {
                for _ in 0..1 + random.next_u64() % 3 {
                    let at = (random.next_u64() % bytes.len() as u64) as usize;
                    match random.next_u64() % 3 {
                        0 => bytes[at] = random.next_u64() as u8,
                        1 => drop(bytes.remove(at)),
                        _ => bytes.insert(at, b"[]=#/\n 19"[(random.next_u64() % 9) as usize]),
                    }
                }
            }
            let text = String::from_utf8_lossy(&text);
            if let Ok(definition) = Definition::parse(Detection2DArray::TYPE, &text) {
                read += u64::from(definition.read(&message).is_ok());
            }
        }
        assert!(read < trials(), "{read}");
    }
}
