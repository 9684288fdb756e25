//! Limits of nesting, memory and time that hold for all log formats.
//!
//! The unpacked size limits the time too, since every byte takes constant time. Limits of single formats (parts of a workbook, length of
//! a line) are with their readers.

/// Maximum unpacked size of a small file, bytes. Bound: an hour at 1 kHz with 37 channels as doubles.
pub const MAX_UNPACKED_BYTES: u64 = 1 << 30;

/// Maximum unpacked over packed size of a larger file. Bound: noisy readings compress to a fifth at best, the text of a sheet to a
/// fifteenth.
pub const MAX_UNPACKED_RATIO: u64 = 20;

/// Maximum unpacked size of a small file whose content is kept in memory, bytes. Bound: an hour at 10 Hz with 100 columns of text, 16
/// bytes each.
const MIN_MEMORY_BYTES: u64 = 64 << 20;

/// Maximum unpacked size of one block, bytes; a reader holds two at a time. The MDF standard recommends 4 MiB. Bound: a reader holds two
/// at a time; the MDF standard recommends 4 MiB.
pub const MAX_BLOCK_BYTES: u64 = 32 << 20;

/// Maximum nesting of a conversion formula, with signs and powers. Bound: polynomials, the deepest formulas of sensors, have about ten
/// levels.
pub const MAX_FORMULA_DEPTH: usize = 64;

/// Maximum number of operators of a conversion formula. Bound: each may be a level of its expression tree.
pub const MAX_FORMULA_OPERATORS: usize = 1000;

/// Maximum unpacked size of a file of this size, bytes.
pub fn max_unpacked_bytes(file_bytes: u64) -> u64 {
    MAX_UNPACKED_BYTES.max(MAX_UNPACKED_RATIO.saturating_mul(file_bytes))
}

/// Maximum unpacked size of a file of this size whose content is kept in memory, bytes.
pub fn max_memory_bytes(file_bytes: u64) -> u64 {
    MAX_UNPACKED_RATIO.saturating_mul(file_bytes).clamp(MIN_MEMORY_BYTES, MAX_UNPACKED_BYTES)
}

/// Whether a formula is nested too deeply for recursion. The parser recurses, and so does the evaluation of chains such as `X+X+X`.
pub fn is_too_deep(text: &[u8]) -> bool {
    let (mut depth, mut deepest, mut signs, mut operators) = (0usize, 0usize, 0usize, 0usize);
    for byte in text {
        match byte {
            b'(' => (depth, signs) = (depth + 1, 0),
            b')' => (depth, signs) = (depth.saturating_sub(1), 0),
            b'+' | b'-' | b'^' | b'*' | b'/' => (signs, operators) = (signs + 1, operators + 1),
            _ => {}
        }
        // A power is a level although an operand precedes it; each sign of a chain is a level.
        deepest = deepest.max(depth + signs);
        if !matches!(byte, b'+' | b'-' | b'^' | b'*' | b'/' | b'(' | b')') && !byte.is_ascii_whitespace() {
            signs = 0;
        }
    }
    deepest > MAX_FORMULA_DEPTH || operators > MAX_FORMULA_OPERATORS
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
        assert_eq!(max_unpacked_bytes(1000), MAX_UNPACKED_BYTES);
        assert_eq!(max_unpacked_bytes(1 << 30), 20 << 30);
        assert_eq!(max_unpacked_bytes(u64::MAX), u64::MAX);
        assert_eq!([0, 10 << 20, u64::MAX].map(max_memory_bytes), [64 << 20, 200 << 20, 1 << 30]);
    }
}
