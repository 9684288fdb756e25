//! Groups registers into few read requests, since each request costs a round trip.

/// Maximum registers per read request.
const MAX_REGISTERS: u16 = 125;
/// Maximum gap of unused registers that is read along: cheaper than another request.
const MAX_GAP: u16 = 8;

/// Neighbouring registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Block {
    /// Address of the first one.
    pub(crate) start: u16,
    /// Number of registers.
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
}
