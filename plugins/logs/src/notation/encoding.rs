//! Text of any encoding as UTF-8.

use encoding_rs::Decoder;
use std::io::{self, Read};

/// Converts text to UTF-8.
pub(crate) struct DecodingReader<R> {
    inner: R,
    decoder: Decoder,
    decoded: io::Cursor<String>,
    is_finished: bool,
}

impl<R: Read> DecodingReader<R> {
    pub(crate) fn new(inner: R, decoder: Decoder) -> Self {
        DecodingReader { inner, decoder, decoded: io::Cursor::default(), is_finished: false }
    }
}

impl<R: Read> Read for DecodingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.decoded.read(buffer)?;
            if count > 0 || self.is_finished || buffer.is_empty() {
                return Ok(count);
            }
            let mut block = [0u8; 8192];
            let count = self.inner.read(&mut block)?;
            self.is_finished = count == 0;
            let mut text = String::with_capacity(self.decoder.max_utf8_buffer_length(count).unwrap_or(0));
            let _ = self.decoder.decode_to_string(&block[..count], &mut text, self.is_finished);
            self.decoded = io::Cursor::new(text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_encoding_becomes_the_same_text() {
        let text = "T2 [°C];Drehzahl ATL 𝄞\n".repeat(1500);
        let wide = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
        for (bytes, encoding) in [
            (wide(u16::to_le_bytes), encoding_rs::UTF_16LE),
            (wide(u16::to_be_bytes), encoding_rs::UTF_16BE),
            (encoding_rs::GB18030.encode(&text).0.into_owned(), encoding_rs::GB18030),
        ] {
            let mut read = String::new();
            let decoder = encoding.new_decoder_without_bom_handling();
            DecodingReader::new(bytes.as_slice(), decoder).read_to_string(&mut read).unwrap();
            assert!(read == text);
        }
    }
}
