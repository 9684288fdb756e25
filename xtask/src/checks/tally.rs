//! Counts of tests, from the output of `cargo test` and `cargo nextest`.

/// Sums over the closing lines of all test programs.
#[derive(Debug, Default, PartialEq)]
pub struct Tally {
    /// Tests that passed.
    pub passed: usize,
    /// Tests that failed.
    pub failed: usize,
    /// Tests that were not run.
    pub ignored: usize,
}

impl Tally {
    /// Adds the counts of a line, if it has any.
    pub fn count(&mut self, line: &str) {
        let line = line.trim_start();
        let counts = match line.strip_prefix("test result: ") {
            Some(counts) => counts,
            // The part after the colon of `Summary [ 1.2s] 12 tests run: 11 passed (1 slow), 1 failed, 2 skipped`.
            None if line.starts_with("Summary [") => {
                line.split_once("run: ").map_or("", |(_, counts)| counts)
            }
            None => return,
        };
        for part in counts.split(['.', ';', ',', '(']) {
            let mut words = part.split_whitespace();
            let (Some(Ok(number)), Some(outcome)) = (words.next().map(str::parse::<usize>), words.next())
            else {
                continue;
            };
            match outcome {
                "passed" => self.passed += number,
                "failed" | "timed" => self.failed += number,
                "ignored" | "skipped" => self.ignored += number,
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tally;

    /// The lines as `cargo test` of Rust 1.95 and cargo-nextest 0.9.143 write them.
    #[test]
    fn closing_lines_add_up() {
        let mut tally = Tally::default();
        for line in [
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.25s",
            "test some::test ... ok",
            "test result: FAILED. 1 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 10.00s",
            "     Summary [   2.531s] 21 tests run: 18 passed (2 slow, 1 leaky), 2 failed, 1 timed out, 4 skipped",
            "        PASS [   0.011s] mapper-core channel::tests::12 passed",
        ] {
            tally.count(line);
        }
        assert_eq!(tally, Tally { passed: 31, failed: 5, ignored: 5 });
    }
}
