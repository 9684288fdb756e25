//! How much a log may ask of its reader, whatever its format: one place for depth, memory and time.
//!
//! Time is bounded by bytes: what a reader unpacks is bounded by the size of the file, and every byte takes constant time. Limits of
//! single formats (parts of a workbook, length of a line) are with their readers.

/// Unpacked size that every file may have, bytes: an hour at 1 kHz with 37 channels as doubles.
pub const UNPACKED_BYTES: u64 = 1 << 30;

/// Unpacked over packed size of a larger file: readings with noise pack to a fifth at best, the text of a sheet to a fifteenth.
pub const UNPACKED_RATIO: u64 = 20;

/// Unpacked size of one block, bytes, of which a reader holds two at a time: the standard of MDF recommends 4 MiB.
pub const BLOCK_BYTES: u64 = 32 << 20;

/// Nesting of a conversion formula, signs and powers included: the deepest formulas of sensors, polynomials, have some ten levels.
pub const FORMULA_DEPTH: usize = 64;

/// Operators of a conversion formula: each may be a level of its expression tree.
pub const FORMULA_OPERATORS: usize = 1000;

/// Unpacked size that a file of this size may have, bytes.
pub fn unpacked_max(file_bytes: u64) -> u64 {
    UNPACKED_BYTES.max(UNPACKED_RATIO.saturating_mul(file_bytes))
}

/// Whether a text, read as a formula, is nested too deeply for a reader that calls itself at each level. Both the parser and the
/// evaluation of chains such as `X+X+X` do.
pub fn is_too_deep(text: &[u8]) -> bool {
    let (mut depth, mut deepest, mut signs, mut operators) = (0usize, 0usize, 0usize, 0usize);
    for byte in text {
        match byte {
            b'(' => (depth, signs) = (depth + 1, 0),
            b')' => (depth, signs) = (depth.saturating_sub(1), 0),
            b'+' | b'-' | b'^' | b'*' | b'/' => (signs, operators) = (signs + 1, operators + 1),
            _ => {}
        }
        // A power is a level although an operand lies before it; a chain of signs is one level each.
        deepest = deepest.max(depth + signs);
        if !matches!(byte, b'+' | b'-' | b'^' | b'*' | b'/' | b'(' | b')') && !byte.is_ascii_whitespace() {
            signs = 0;
        }
    }
    deepest > FORMULA_DEPTH || operators > FORMULA_OPERATORS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_of_sensors_pass_and_towers_do_not() {
        for usual in ["4*X^2 + 1.5", "((((a+b)*X)+c)*X+d)*X + exp(-(X/3)^2)", "---X", ""] {
            assert!(!is_too_deep(usual.as_bytes()), "{usual}");
        }
        for (part, end) in [("(", ")"), ("-", ""), ("sin(", ")"), ("+ ", ""), ("X+", ""), ("2^", "")] {
            let deep = part.repeat(100_000) + "X" + &end.repeat(100_000);
            assert!(is_too_deep(deep.as_bytes()), "{part}");
        }
    }

    #[test]
    fn a_file_may_unpack_to_a_multiple_of_its_size() {
        assert_eq!(unpacked_max(1000), UNPACKED_BYTES);
        assert_eq!(unpacked_max(1 << 30), 20 << 30);
        assert_eq!(unpacked_max(u64::MAX), u64::MAX);
    }
}
