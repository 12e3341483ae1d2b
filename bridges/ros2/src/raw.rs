//! Messages in serialised form, for types that only the log reader knows.

use std::convert::Infallible;

use ros2_client::dds::rustdds::RepresentationIdentifier;
use ros2_client::dds::rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter};

/// Adapter of a DDS reader that passes messages on without decoding them.
pub(crate) struct RawAdapter;

/// Decoder of [`RawAdapter`].
#[derive(Clone)]
pub(crate) struct RawDecoder;

impl DeserializerAdapter<Vec<u8>> for RawAdapter {
    type Error = Infallible;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE]
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for RawAdapter {
    type Decoder = RawDecoder;
    const DECODER: RawDecoder = RawDecoder;
}

impl<'de> Decode<'de, Vec<u8>> for RawDecoder {
    type Error = Infallible;

    /// Returns the message with its encapsulation header, which DDS removes.
    fn decode_bytes(
        self,
        message: &'de [u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Vec<u8>, Infallible> {
        let is_little = encoding == RepresentationIdentifier::CDR_LE;
        let header = [0, u8::from(is_little), 0, 0];
        Ok([header.as_slice(), message].concat())
    }
}

#[cfg(test)]
mod tests {
    use tagalong::core::Stamp;
    use tagalong::log::msgs::{Header, decode, encode};

    use super::*;

    #[test]
    fn a_message_has_its_encapsulation_again() {
        let header = Header::new(Stamp::from_nanos(7), "bumper");
        let written = encode(&header);
        let read = RawAdapter::from_bytes(&written[4..], RepresentationIdentifier::CDR_LE).unwrap();
        assert_eq!(read, written);
        assert_eq!(decode::<Header>(&read).unwrap(), header);
        let big = RawAdapter::from_bytes(&[1], RepresentationIdentifier::CDR_BE).unwrap();
        assert_eq!(big, [0, 0, 0, 0, 1]);
    }
}
