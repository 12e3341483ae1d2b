//! Fast decoders of depth against slow ones.

use proptest::prelude::*;

use super::*;

/// Returns a PNG of filtered rows of 16 bits of grey, its data in chunks of so many bytes.
fn deep_png_of(width: u32, height: u32, filtered: &[u8], chunk: usize) -> Vec<u8> {
    let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
    let header = [&size[..], &[16, 0, 0, 0, 0]].concat();
    let stream = fdeflate::compress_to_vec(filtered);
    let parts = stream.chunks(chunk).map(|part| (b"IDAT", part));
    let chunks = [(b"IHDR", &header[..]), (b"tIME", &[7, 234, 1, 2, 3, 4, 5][..])];
    let mut data = b"\x89PNG\r\n\x1a\n".to_vec();
    for (kind, content) in chunks.into_iter().chain(parts).chain([(b"IEND", &[][..])]) {
        let body = [&kind[..], content].concat();
        data.extend((content.len() as u32).to_be_bytes());
        data.extend(&body);
        data.extend(crc32fast::hash(&body).to_be_bytes());
    }
    data
}

/// Returns the depth in a PNG as the `png` crate reads it.
fn complete_png(data: &[u8]) -> Option<Vec<f32>> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(data)).read_info().ok()?;
    let mut bytes = vec![0; reader.output_buffer_size()?];
    reader.next_frame(&mut bytes).ok()?;
    let values = bytes.as_chunks::<2>().0.iter();
    Some(values.map(|v| metres(u16::from_be_bytes(*v), 0.001)).collect())
}

/// Larger than what the inflater keeps, with repetitions over its whole reach, and one byte wrong.
#[test]
fn a_large_deep_png_is_that_of_the_complete_decoder() {
    for filter in [png::Filter::Sub, png::Filter::Adaptive] {
        let noise = noise(15_000);
        let values: Vec<u16> = (0..640 * 203)
            .map(|i: usize| 900 + (i / 640) as u16 + u16::from(noise[i % 15_000] % 8))
            .collect();
        let mut data = Vec::new();
        let mut encoder = png::Encoder::new(&mut data, 640, 203);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        encoder.set_filter(filter);
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
        encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
        let fast = fast_png(&data).unwrap();
        assert_eq!((fast.width(), fast.height()), (640, 203));
        assert!(same_depth(fast.pixels(), &complete_png(&data).unwrap()));
        let middle = data.len() / 2;
        data[middle] ^= 1;
        assert!(fast_png(&data).is_none() && complete_png(&data).is_none());
    }
}

/// The decoder for depth alone.
fn fast_png(data: &[u8]) -> Option<DepthImage> {
    deep_png::decode(data, &Limits::default(), |v| metres(v, 0.001))
}

/// RVL by its definition, a nibble at a time.
fn slow_rvl(bytes: &[u8], count: usize) -> Option<Vec<u16>> {
    let words = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
    let mut nibbles = words.flat_map(|word| (0..8).map(move |i| word >> (28 - 4 * i) & 15));
    let mut out = Vec::new();
    let mut last = 0_u16;
    while out.len() < count {
        let zeros = slow_number(&mut nibbles)? as usize;
        out.extend((0..zeros.min(count + 1)).map(|_| 0));
        let readings = slow_number(&mut nibbles)?;
        if out.len() + readings as usize > count {
            return None;
        }
        for _ in 0..readings {
            let coded = slow_number(&mut nibbles)? as i32;
            let step = if coded & 1 == 0 { coded as u32 >> 1 } else { !(coded as u32 >> 1) };
            last = last.wrapping_add(step as u16);
            out.push(last);
        }
    }
    Some(out)
}

/// The next number, three bits at a time; the fourth bit of a nibble says that it goes on.
fn slow_number(nibbles: &mut impl Iterator<Item = u32>) -> Option<u32> {
    let mut value = 0;
    for shift in (0..32).step_by(3) {
        let nibble = nibbles.next()?;
        value |= (nibble & 7) << shift;
        if nibble & 8 == 0 {
            return Some(value);
        }
    }
    None
}

proptest! {
    /// Rows of any filters, also of unknown ones, by the decoder that reads all kinds of PNG.
    #[test]
    fn deep_pngs_are_those_of_the_complete_decoder(
        width in 1..30_usize,
        filters in proptest::collection::vec(0..50_u8, 1..30),
        bytes in proptest::collection::vec(any::<u8>(), 60 * 30),
        chunk in 1..300_usize,
    ) {
        let rows = filters.iter().zip(bytes.chunks(2 * width));
        // One of fifty is an unknown one.
        let filtered: Vec<u8> = rows
            .flat_map(|(filter, row)| [if *filter == 49 { 5 } else { filter % 5 }].into_iter().chain(row.iter().copied()))
            .collect();
        let data = deep_png_of(width as u32, filters.len() as u32, &filtered, chunk);
        let fast = deep_png::decode(&data, &Limits::default(), |v| metres(v, 0.001));
        let slow = complete_png(&data);
        prop_assert_eq!(fast.is_some(), slow.is_some());
        if let (Some(fast), Some(slow)) = (fast, slow) {
            prop_assert!(same_depth(fast.pixels(), &slow));
        }
    }

    /// Also damaged streams, and numbers of more nibbles than they need.
    #[test]
    fn rvl_is_its_definition(
        steps in proptest::collection::vec(any::<i16>(), 1..200),
        narrow in 0..16_u32,
        at in 0..800_usize,
        with in any::<u8>(),
        cut in 0..8_usize,
    ) {
        let mut last = 1000_i16;
        let mut values: Vec<u16> = Vec::new();
        for step in steps {
            last = last.wrapping_add(step >> narrow);
            values.push(last as u16);
        }
        let mut coded = rvl::encode(&values);
        coded.truncate(coded.len() - cut.min(coded.len()));
        for _ in 0..2 {
            prop_assert_eq!(rvl::decode(&coded, values.len(), |v| v), slow_rvl(&coded, values.len()));
            let length = coded.len();
            coded.get_mut(at % length.max(1)).into_iter().for_each(|byte| *byte = with);
        }
    }
}
