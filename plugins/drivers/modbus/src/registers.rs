//! Registers of a PLC: their values, and the blocks in which they are read.

use mapper_core::named_enum;

/// Maximum registers per read request.
const MAX_REGISTERS: u16 = 125;
/// Maximum gap of unused registers that is read along: cheaper than another request.
const MAX_GAP: u16 = 8;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Block {
    pub(crate) start: u16,
    pub(crate) count: u16,
}

/// Blocks that cover all these pieces without splitting one. A piece is at most 4 registers.
pub(crate) fn group_registers(pieces: &[Block]) -> Vec<Block> {
    let mut pieces = pieces.to_vec();
    pieces.sort_by_key(|piece| (piece.start, piece.count));
    let mut blocks: Vec<Block> = Vec::new();
    for piece in pieces {
        let end = u32::from(piece.start) + u32::from(piece.count);
        if let Some(last) = blocks.last_mut() {
            let last_end = u32::from(last.start) + u32::from(last.count);
            let merged_count = end.max(last_end) - u32::from(last.start);
            if u32::from(piece.start) <= last_end + u32::from(MAX_GAP)
                && merged_count <= u32::from(MAX_REGISTERS)
            {
                last.count = u16::try_from(merged_count).unwrap_or(MAX_REGISTERS);
                continue;
            }
        }
        blocks.push(piece);
    }
    blocks
}

named_enum! {
    /// Number format in registers.
    #[derive(Default)]
    pub(crate) enum NumberFormat {
        U16 = "u16",
        I16 = "i16",
        U32 = "u32",
        I32 = "i32",
        #[default]
        F32 = "f32",
        F64 = "f64",
    }
}

named_enum! {
    /// Order of words, or of bytes in a word.
    #[derive(Default)]
    pub(crate) enum Order {
        /// Most significant first, the Modbus default.
        #[default]
        Big = "big",
        /// Least significant first.
        Little = "little",
    }
}

impl NumberFormat {
    pub(crate) fn is_whole(self) -> bool {
        !matches!(self, NumberFormat::F32 | NumberFormat::F64)
    }

    pub(crate) fn count(self) -> u16 {
        match self {
            NumberFormat::U16 | NumberFormat::I16 => 1,
            NumberFormat::U32 | NumberFormat::I32 | NumberFormat::F32 => 2,
            NumberFormat::F64 => 4,
        }
    }

    /// The number in these registers; `None` for too few registers, NaN if they hold no number.
    pub(crate) fn number(self, registers: &[u16], words: Order, bytes: Order) -> Option<f64> {
        let mut registers = registers.get(..usize::from(self.count()))?.to_vec();
        if words == Order::Little {
            registers.reverse();
        }
        let bits = registers.iter().fold(0u64, |bits, register| {
            let register = if bytes == Order::Little { register.swap_bytes() } else { *register };
            bits << 16 | u64::from(register)
        });
        // Each cast reinterprets the same bits.
        Some(match self {
            NumberFormat::U16 | NumberFormat::U32 => bits as f64,
            NumberFormat::I16 => f64::from(bits as u16 as i16),
            NumberFormat::I32 => f64::from(bits as u32 as i32),
            NumberFormat::F32 => f64::from(f32::from_bits(bits as u32)),
            NumberFormat::F64 => f64::from_bits(bits),
        })
    }

    /// The registers for a number; `None` if it does not fit.
    pub(crate) fn registers(self, number: f64, words: Order, bytes: Order) -> Option<Vec<u16>> {
        let rounded = number.round();
        let within = |low: f64, high: f64| (low..=high).contains(&rounded);
        let bits = match self {
            NumberFormat::U16 if within(0.0, f64::from(u16::MAX)) => rounded as u64,
            NumberFormat::U32 if within(0.0, f64::from(u32::MAX)) => rounded as u64,
            NumberFormat::I16 if within(f64::from(i16::MIN), f64::from(i16::MAX)) => {
                rounded as i16 as u16 as u64
            }
            NumberFormat::I32 if within(f64::from(i32::MIN), f64::from(i32::MAX)) => {
                rounded as i32 as u32 as u64
            }
            NumberFormat::F32 if (number as f32).is_finite() => u64::from((number as f32).to_bits()),
            NumberFormat::F64 if number.is_finite() => number.to_bits(),
            _ => return None,
        };
        let mut registers: Vec<u16> =
            (0..self.count()).rev().map(|place| (bits >> (16 * place)) as u16).collect();
        if bytes == Order::Little {
            registers.iter_mut().for_each(|register| *register = register.swap_bytes());
        }
        if words == Order::Little {
            registers.reverse();
        }
        Some(registers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Each piece lies in one block, no block exceeds the limit of a request, and no register beyond the last is requested.
        #[test]
        fn blocks_cover_all_pieces(starts in prop::collection::vec((0u16..65_532, 1u16..=4), 1..40)) {
            let pieces: Vec<Block> = starts.iter().map(|(start, count)| Block { start: *start, count: *count }).collect();
            let blocks = group_registers(&pieces);
            for block in &blocks {
                prop_assert!(block.count <= MAX_REGISTERS && u32::from(block.start) + u32::from(block.count) <= 65_536);
            }
            for piece in &pieces {
                let is_covered = blocks.iter().any(|block| {
                    block.start <= piece.start
                        && u32::from(piece.start) + u32::from(piece.count)
                            <= u32::from(block.start) + u32::from(block.count)
                });
                prop_assert!(is_covered, "{piece:?} in {blocks:?}");
            }
        }
    }

    #[test]
    fn neighbours_share_a_request_and_far_ones_do_not() {
        let piece = |start| Block { start, count: 2 };
        let found = group_registers(&[piece(200), piece(0), piece(2), piece(10)]);
        assert_eq!(found, [Block { start: 0, count: 12 }, Block { start: 200, count: 2 }]);
    }

    /// 123456.0 as a single is 0x47F12000 (IEEE 754); the four orders of manuals: ABCD, CDAB, BADC, DCBA.
    #[test]
    fn the_four_word_and_byte_orders_are_read_and_written() {
        for (words, bytes, registers) in [
            (Order::Big, Order::Big, [0x47f1, 0x2000]),
            (Order::Little, Order::Big, [0x2000, 0x47f1]),
            (Order::Big, Order::Little, [0xf147, 0x0020]),
            (Order::Little, Order::Little, [0x0020, 0xf147]),
        ] {
            assert_eq!(NumberFormat::F32.number(&registers, words, bytes), Some(123_456.0));
            assert_eq!(NumberFormat::F32.registers(123_456.0, words, bytes).unwrap(), registers);
        }
        assert_eq!(NumberFormat::I16.number(&[0xffff], Order::Big, Order::Big), Some(-1.0));
        assert_eq!(NumberFormat::I32.number(&[0xffff, 0xfffe], Order::Big, Order::Big), Some(-2.0));
        assert_eq!(NumberFormat::F32.number(&[1], Order::Big, Order::Big), None);
        assert!(NumberFormat::U16.registers(65_536.0, Order::Big, Order::Big).is_none());
        assert!(NumberFormat::F32.registers(f64::NAN, Order::Big, Order::Big).is_none());
    }

    proptest! {
        #[test]
        fn written_numbers_are_read_back(value in -30_000i16..30_000, little_words in any::<bool>(), little_bytes in any::<bool>()) {
            let order = |little| if little { Order::Little } else { Order::Big };
            let (words, bytes) = (order(little_words), order(little_bytes));
            for form in [NumberFormat::I16, NumberFormat::I32, NumberFormat::F32, NumberFormat::F64] {
                let registers = form.registers(f64::from(value), words, bytes).unwrap();
                prop_assert_eq!(form.number(&registers, words, bytes), Some(f64::from(value)));
            }
        }
    }
}
