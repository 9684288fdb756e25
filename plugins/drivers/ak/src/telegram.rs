//! The AK telegram as manuals print it: STX, a don't-care byte, four letters, a blank, the channel (`K0`) or the error status, data, ETX.
//!
//! Testo CU-2 and NanoMet3, CAI 600 and 700, Servomex ServoPro, Emerson NGA 2000 ("AK-Protocol", 90003752).

use std::str::FromStr;

const STX: u8 = 0x02;
const ETX: u8 = 0x03;
/// Default of the don't-care byte after STX.
const DONT_CARE: u8 = b' ';
/// Maximum length of a telegram, bytes: some hundred numbers.
const MAX_BYTES: usize = 4096;
/// Answer of an instrument to an unknown code.
const UNKNOWN: [u8; 4] = *b"????";

/// Four capital letters, digits allowed: `AKON`, `ASTZ`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Code([u8; 4]);

impl Code {
    /// Whether the code is a read request. Other codes control (`S`) or configure (`E`) an instrument.
    pub fn is_read_request(self) -> bool {
        self.0[0] == b'A'
    }
}

impl FromStr for Code {
    type Err = TelegramError;

    fn from_str(text: &str) -> Result<Code, TelegramError> {
        let fits =
            |bytes: &[u8; 4]| bytes.iter().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit());
        let code = <[u8; 4]>::try_from(text.as_bytes()).ok().filter(fits);
        code.map(Code).ok_or_else(|| TelegramError::InvalidCode(text.to_owned()))
    }
}

impl std::fmt::Display for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&String::from_utf8_lossy(&self.0))
    }
}

/// Why bytes are not a valid telegram, or not the expected one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum TelegramError {
    #[error("`{0}` is not a code of four capital letters, such as AKON")]
    InvalidCode(String),
    #[error("{0:?} is not an AK telegram")]
    Malformed(String),
    #[error("the instrument does not know {0}")]
    Unknown(Code),
    #[error("the answer is to {found}, not to {requested}")]
    Other { requested: Code, found: String },
}

/// The request for a channel of the instrument, with parameters.
pub fn write_request(code: Code, channel: u8, parameters: &str) -> Vec<u8> {
    let mut telegram = vec![STX, DONT_CARE];
    telegram.extend(code.0);
    telegram.extend(format!(" K{channel}").bytes());
    if !parameters.is_empty() {
        // Control characters would end the telegram early.
        let plain = parameters.bytes().filter(|byte| (b' '..=b'~').contains(byte));
        telegram.push(b' ');
        telegram.extend(plain);
    }
    telegram.push(ETX);
    telegram
}

/// An answer of an instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// 0: the instrument has no error; 1 to 9, which counts up with each change of its errors.
    pub error: u8,
    /// The data fields.
    pub words: Vec<String>,
}

impl Answer {
    /// The number at this position, from 1; `None` if it is missing or marked invalid by `#`.
    pub fn number(&self, position: usize) -> Option<f64> {
        let word = self.words.get(position.checked_sub(1)?)?;
        // Rust parses "inf" and "nan" as numbers, but instruments do not write them.
        let plain = word.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte));
        word.parse::<f64>().ok().filter(|number| plain && number.is_finite())
    }
}

/// Parses the answer to a request; `body` is the text between STX and ETX.
pub fn parse_answer(body: &[u8], requested: Code) -> Result<Answer, TelegramError> {
    let malformed = || TelegramError::Malformed(String::from_utf8_lossy(body).into_owned());
    let (Some(code), Some(b' '), Some(status)) = (body.get(1..5), body.get(5), body.get(6)) else {
        return Err(malformed());
    };
    if code == UNKNOWN {
        return Err(TelegramError::Unknown(requested));
    }
    if code != requested.0 {
        return Err(TelegramError::Other { requested, found: String::from_utf8_lossy(code).into_owned() });
    }
    let data = body.get(7..).unwrap_or_default();
    let separated = data.first().is_none_or(|byte| b" \r\n".contains(byte));
    if !status.is_ascii_digit() || !separated || !data.is_ascii() {
        return Err(malformed());
    }
    let words = data.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let words = words.map(|word| String::from_utf8_lossy(word).into_owned()).collect();
    Ok(Answer { error: status - b'0', words })
}

/// Assembles telegrams from a byte stream.
#[derive(Debug, Default)]
pub struct Assembler {
    /// Bytes since STX; `None` before STX.
    body: Option<Vec<u8>>,
}

impl Assembler {
    /// Takes the next byte. Returns the text between STX and ETX once a telegram is complete. Each STX starts a new telegram.
    pub fn push(&mut self, byte: u8) -> Option<Vec<u8>> {
        match byte {
            STX => {
                self.body = Some(Vec::new());
                None
            }
            ETX => self.body.take(),
            _ => {
                let body = self.body.as_mut()?;
                body.push(byte);
                if body.len() > MAX_BYTES {
                    self.body = None;
                }
                None
            }
        }
    }
}

/// Parses a request to an instrument: code, channel and parameters.
pub fn parse_request(body: &[u8]) -> Result<(Code, u8, String), TelegramError> {
    let malformed = || TelegramError::Malformed(String::from_utf8_lossy(body).into_owned());
    let text = std::str::from_utf8(body.get(1..).ok_or_else(malformed)?).map_err(|_| malformed())?;
    let mut words = text.splitn(3, ' ');
    let code = words.next().unwrap_or_default().parse()?;
    let channel = words.next().and_then(|word| word.strip_prefix('K')).and_then(|word| word.parse().ok());
    Ok((code, channel.ok_or_else(malformed)?, words.next().unwrap_or_default().to_owned()))
}

/// The answer of an instrument without errors; with `None`, the answer to an unknown code.
pub fn write_answer(code: Option<Code>, words: &[String]) -> Vec<u8> {
    let mut telegram = vec![STX, DONT_CARE];
    telegram.extend(code.map_or(UNKNOWN, |code| code.0));
    telegram.extend(b" 0");
    for word in words {
        telegram.push(b' ');
        telegram.extend(word.bytes().filter(|byte| (b'!'..=b'~').contains(byte)));
    }
    telegram.push(ETX);
    telegram
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bodies(bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut assembler = Assembler::default();
        bytes.iter().filter_map(|byte| assembler.push(*byte)).collect()
    }

    fn code(text: &str) -> Code {
        text.parse().unwrap()
    }

    /// The example of the CAI and Servomex manuals: 02H 20H "ASTZ" 20H "K0" 03H, answered by "ASTZ 0 SREM STBY".
    #[test]
    fn the_example_of_the_manuals_is_written_and_read() {
        assert_eq!(write_request(code("ASTZ"), 0, ""), b"\x02 ASTZ K0\x03");
        let found = bodies(b"\x02 ASTZ 0 SREM STBY\x03");
        let answer = parse_answer(&found[0], code("ASTZ")).unwrap();
        assert_eq!((answer.error, answer.words), (0, vec!["SREM".to_owned(), "STBY".to_owned()]));
        // Testo: the don't-care byte is 30H, an unknown code is echoed as ????.
        let found = bodies(b"\x020???? 0\x03");
        assert_eq!(super::parse_answer(&found[0], code("AXXX")), Err(TelegramError::Unknown(code("AXXX"))));
    }

    /// Numbers in plain and E notation, separated by blanks or by line ends; the error status is parsed too.
    #[test]
    fn numbers_are_read_by_position() {
        let found = bodies(b"\x020AKON 3 12.5 -1.25E+02\r\n#7.0 0 inf\x03");
        let answer = parse_answer(&found[0], code("AKON")).unwrap();
        let numbers: Vec<_> = (0..=6).map(|position| answer.number(position)).collect();
        assert_eq!(numbers, [None, Some(12.5), Some(-125.0), None, Some(0.0), None, None]);
        assert_eq!(answer.error, 3);
    }

    /// If the end of a telegram is lost, the next STX starts a new one.
    #[test]
    fn incomplete_telegrams_are_discarded() {
        assert_eq!(bodies(b"noise\x03\x02 AKON 0 1\x02 AKON 0 2\x03"), [b" AKON 0 2".to_vec()]);
        assert!(bodies(&[&b"\x02 AKON 0 "[..], &[b'1'; 5000], b"\x03"].concat()).is_empty());
        for malformed in [&b""[..], b" AKO", b" AKON", b" AKON 0x", b" AKON  1", b" AKON0 1", b" AKON 0 \xff"]
        {
            assert!(
                matches!(parse_answer(malformed, code("AKON")), Err(TelegramError::Malformed(_))),
                "{malformed:?}"
            );
        }
        assert!(matches!(parse_answer(b" ASTF 0", code("AKON")), Err(TelegramError::Other { .. })));
    }

    proptest! {
        #[test]
        fn any_bytes_are_parsed_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            for body in bodies(&bytes) {
                let _ = parse_answer(&body, code("AKON")).map(|answer| answer.number(1));
                let _ = parse_request(&body);
            }
            let _ = parse_answer(&bytes, code("AKON"));
        }

        #[test]
        fn written_requests_and_answers_are_read_back(channel in 0u8..100, numbers in prop::collection::vec(-1e6f64..1e6, 0..40)) {
            let write_request = bodies(&write_request(code("AKON"), channel, "1 2"));
            prop_assert_eq!(parse_request(&write_request[0]).unwrap(), (code("AKON"), channel, "1 2".to_owned()));
            let words: Vec<String> = numbers.iter().map(|number| number.to_string()).collect();
            let found = bodies(&write_answer(Some(code("AKON")), &words));
            let answer = parse_answer(&found[0], code("AKON")).unwrap();
            let read: Vec<f64> = (1..=numbers.len()).filter_map(|position| answer.number(position)).collect();
            prop_assert_eq!(read, numbers);
        }
    }
}
