//! Messages as ROS 1 serialises them: little endian, without alignment, lists and strings preceded
//! by their length, and a sequence number at the start of each header.

use std::fmt::Display;

use serde::de::{
    DeserializeSeed, Deserializer, Error as _, IntoDeserializer, SeqAccess, Visitor, value,
};
use serde::{Deserialize, forward_to_deserialize_any};

/// Reads a message that has no encapsulation header; bytes after it are allowed.
pub(super) fn from_bytes<'de, T: Deserialize<'de>>(bytes: &'de [u8]) -> Result<T, String> {
    T::deserialize(&mut Ros1 { rest: bytes }).map_err(|error| error.0)
}

/// Error of a message that does not fit its type.
#[derive(Debug)]
struct Misfit(String);

impl Display for Misfit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Misfit {}

impl serde::de::Error for Misfit {
    fn custom<T: Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

/// Reader of the bytes of a message.
struct Ros1<'de> {
    rest: &'de [u8],
}

impl<'de> Ros1<'de> {
    fn take(&mut self, count: usize) -> Result<&'de [u8], Misfit> {
        let split = self.rest.split_at_checked(count);
        let (taken, rest) = split.ok_or_else(|| Misfit::custom("it ends early"))?;
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Misfit> {
        self.take(N)?.try_into().map_err(Misfit::custom)
    }

    fn length(&mut self) -> Result<usize, Misfit> {
        Ok(u32::from_le_bytes(self.array()?) as usize)
    }
}

/// Elements of a list, an array or a struct.
struct Elements<'a, 'de> {
    reader: &'a mut Ros1<'de>,
    left: usize,
}

impl<'de> SeqAccess<'de> for Elements<'_, 'de> {
    type Error = Misfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Misfit> {
        let Some(left) = self.left.checked_sub(1) else { return Ok(None) };
        self.left = left;
        seed.deserialize(&mut *self.reader).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        // A wrong length costs no more memory than there are bytes.
        Some(self.left.min(self.reader.rest.len()))
    }
}

macro_rules! numbers {
    ($($method:ident $visit:ident $type:ty),*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
            visitor.$visit(<$type>::from_le_bytes(self.array()?))
        }
    )*};
}

impl<'de> Deserializer<'de> for &mut Ros1<'de> {
    type Error = Misfit;

    numbers!(
        deserialize_u8 visit_u8 u8, deserialize_u16 visit_u16 u16,
        deserialize_u32 visit_u32 u32, deserialize_u64 visit_u64 u64,
        deserialize_i8 visit_i8 i8, deserialize_i16 visit_i16 i16,
        deserialize_i32 visit_i32 i32, deserialize_i64 visit_i64 i64,
        deserialize_f32 visit_f32 f32, deserialize_f64 visit_f64 f64
    );

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Misfit> {
        Err(Misfit::custom("the type says nothing of its layout"))
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let [byte] = self.array()?;
        visitor.visit_bool(byte != 0)
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let length = self.length()?;
        visitor.visit_borrowed_str(std::str::from_utf8(self.take(length)?).map_err(Misfit::custom)?)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        self.deserialize_str(visitor)
    }

    fn deserialize_bytes<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let length = self.length()?;
        visitor.visit_borrowed_bytes(self.take(length)?)
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        self.deserialize_bytes(visitor)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let left = self.length()?;
        visitor.visit_seq(Elements { reader: self, left })
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, left: usize, v: V) -> Result<V::Value, Misfit> {
        v.visit_seq(Elements { reader: self, left })
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        left: usize,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        self.deserialize_tuple(left, visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        if name == "Header" {
            // The sequence number, which ROS 2 does not have.
            self.take(4)?;
        }
        self.deserialize_tuple(fields.len(), visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        let number: value::U32Deserializer<Misfit> =
            u32::from_le_bytes(self.array()?).into_deserializer();
        visitor.visit_enum(number)
    }

    forward_to_deserialize_any! { i128 u128 char option unit unit_struct map identifier ignored_any }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msgs::{Header, LaserScan, TFMessage, Time};

    fn header(frame: &str) -> Vec<u8> {
        let mut out = [7_u32, 5, 600].map(u32::to_le_bytes).concat();
        out.extend((frame.len() as u32).to_le_bytes());
        out.extend(frame.as_bytes());
        out
    }

    #[test]
    fn numbers_follow_each_other_without_gaps() {
        let mut bytes = header("las");
        let fixed = [-1.0_f32, 1.0, 0.5, 0.0, 0.1, 0.2, 9.0];
        bytes.extend(fixed.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(2_u32.to_le_bytes());
        bytes.extend([3.5_f32, f32::INFINITY].iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(0_u32.to_le_bytes());
        let scan: LaserScan = from_bytes(&bytes).unwrap();
        let stamp = Time { sec: 5, nanosec: 600 };
        assert_eq!(scan.header, Header { stamp, frame_id: "las".into() });
        assert_eq!((scan.range_min, scan.range_max), (0.2, 9.0));
        assert_eq!((scan.ranges, scan.intensities.len()), (vec![3.5, f32::INFINITY], 0));
        for end in 0..bytes.len() {
            assert!(from_bytes::<LaserScan>(&bytes[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn a_wrong_length_is_an_error_and_takes_no_memory() {
        let error = from_bytes::<TFMessage>(&u32::MAX.to_le_bytes()).unwrap_err();
        assert!(error.contains("ends early"), "{error}");
    }
}
