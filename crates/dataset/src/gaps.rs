//! Rows that a data set lacks.

/// Rows that are named at most, whatever is asked for: a file may say that 2^64 were to be made.
const MOST_NAMED: usize = 1 << 20;

/// What is missing among rows that come in order.
#[derive(Clone, Debug)]
pub(crate) struct Gaps {
    /// The first that are missing, as many as are to be named.
    pub(crate) first: Vec<u64>,
    /// How many are missing in all.
    pub(crate) count: u64,
    limit: usize,
    /// The row that comes next if none is missing.
    next: u64,
}

impl Gaps {
    /// None yet; names at most `limit`, and a million.
    pub(crate) fn new(limit: usize) -> Self {
        Self { first: Vec::new(), count: 0, limit: limit.min(MOST_NAMED), next: 0 }
    }

    /// Takes the next row that is there.
    pub(crate) fn pass(&mut self, row: u64) {
        self.reach(row);
        self.next = self.next.max(row.saturating_add(1));
    }

    /// All rows have come; those after the last are missing where more were asked for.
    pub(crate) fn end(&mut self, asked: Option<u64>) {
        self.reach(asked.unwrap_or(0));
    }

    fn reach(&mut self, row: u64) {
        let named = self.limit - self.first.len();
        self.first.extend((self.next..row).take(named));
        self.count += row.saturating_sub(self.next);
        self.next = self.next.max(row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_missing_before_between_and_after_those_that_are_there() {
        let lacks = |rows: &[u64], asked| {
            let mut gaps = Gaps::new(3);
            for &row in rows {
                gaps.pass(row);
            }
            gaps.end(asked);
            (gaps.count, gaps.first)
        };
        assert_eq!(lacks(&[0, 1, 2], Some(3)), (0, vec![]));
        assert_eq!(lacks(&[2, 3, 6], None), (4, vec![0, 1, 4]));
        assert_eq!(lacks(&[0, 1], Some(u64::MAX)), (u64::MAX - 2, vec![2, 3, 4]));
        assert_eq!(lacks(&[], Some(2)), (2, vec![0, 1]));
        // Fewer were asked for than are there.
        assert_eq!(lacks(&[0, 2], Some(1)), (1, vec![1]));
        assert_eq!(lacks(&[], None), (0, vec![]));
    }

    #[test]
    fn not_all_are_named_where_no_memory_holds_them() {
        let mut gaps = Gaps::new(usize::MAX);
        gaps.end(Some(u64::MAX));
        assert_eq!((gaps.count, gaps.first.len()), (u64::MAX, MOST_NAMED));
    }
}
