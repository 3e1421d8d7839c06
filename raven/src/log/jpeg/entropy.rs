//! Huffman-coded blocks of 8x8 coefficients (ITU-T T.81, F.2.2), read or passed over.

/// Bits that one look at the table resolves; longer codes are rare and take a walk over the lengths.
const FAST_BITS: u32 = 9;
/// Bits that are certain to be there after a refill, unless the data end: a code and its value take 32 at most.
const REFILL_BELOW: u32 = 32;

/// Natural order of the coefficients, which are sent along diagonals.
const ZIGZAG: [u8; 64] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7, 14, 21, 28, 35, 42, 49, 56,
    57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
];

/// A code of a Huffman table.
#[derive(Debug, Clone)]
pub(super) struct Huffman {
    /// Length and symbol by the next bits; length 0 where the code is longer.
    fast: Vec<[u8; 2]>,
    /// First code of each length from 1, the number of codes, and the index of the first symbol.
    lengths: [[u32; 3]; 16],
    symbols: Vec<u8>,
}

impl Huffman {
    /// From a segment's counts and symbols; `None` if there are more codes than a length has.
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut table = Self { fast: vec![[0; 2]; 1 << FAST_BITS], lengths: [[0; 3]; 16], symbols: symbols.to_vec() };
        let (mut code, mut index) = (0_u32, 0_usize);
        for ((length, &count), entry) in (1_u32..).zip(counts).zip(&mut table.lengths) {
            let count = u32::from(count);
            *entry = [code, count, index as u32];
            if code + count > 1 << length {
                return None;
            }
            let these = symbols.get(index..index + count as usize)?;
            if length <= FAST_BITS {
                let from = (code << (FAST_BITS - length)) as usize;
                let each = 1 << (FAST_BITS - length);
                for (fast, &symbol) in table.fast.get_mut(from..from + these.len() * each)?.chunks_exact_mut(each).zip(these) {
                    fast.fill([length as u8, symbol]);
                }
            }
            index += these.len();
            code = (code + count) << 1;
        }
        Some(table)
    }

    /// Length and symbol of the code that the next 16 bits begin with.
    #[inline(always)]
    fn next(&self, ahead: u32) -> Option<[u32; 2]> {
        match self.fast.get((ahead >> (16 - FAST_BITS)) as usize) {
            Some(&[length, symbol]) if length > 0 => Some([length.into(), symbol.into()]),
            _ => self.next_long(ahead),
        }
    }

    #[cold]
    fn next_long(&self, ahead: u32) -> Option<[u32; 2]> {
        (1..=16).zip(&self.lengths).find_map(|(length, &[first, count, index])| {
            let offset = (ahead >> (16 - length)).checked_sub(first).filter(|&offset| offset < count)?;
            Some([length, (*self.symbols.get((index + offset) as usize)?).into()])
        })
    }
}

/// The bits of a scan, without the zeros that follow a byte of ones.
pub(super) struct Scan<'a> {
    rest: &'a [u8],
    bits: u64,
    count: u32,
}

impl<'a> Scan<'a> {
    pub(super) const fn new(data: &'a [u8]) -> Self {
        Self { rest: data, bits: 0, count: 0 }
    }

    /// Bits to be had; zeros where the data end or a marker comes.
    #[inline(always)]
    fn refill(&mut self) {
        if let Some((four, after)) = self.rest.split_first_chunk::<4>()
            && !four.contains(&0xFF)
        {
            self.bits |= u64::from(u32::from_be_bytes(*four)) << (REFILL_BELOW - self.count);
            self.count += 32;
            self.rest = after;
        } else {
            self.refill_by_bytes();
        }
    }

    #[cold]
    fn refill_by_bytes(&mut self) {
        while self.count <= 56 {
            let byte = match self.rest {
                [0xFF, 0, after @ ..] => {
                    self.rest = after;
                    0xFF
                }
                [0xFF, ..] | [] => 0,
                [byte, after @ ..] => {
                    self.rest = after;
                    *byte
                }
            };
            self.bits |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    #[inline(always)]
    fn symbol(&mut self, table: &Huffman) -> Option<u32> {
        if self.count < REFILL_BELOW {
            self.refill();
        }
        let [length, symbol] = table.next((self.bits >> 48) as u32)?;
        self.drop(length);
        Some(symbol)
    }

    #[inline(always)]
    const fn drop(&mut self, count: u32) {
        self.bits <<= count;
        self.count -= count;
    }

    /// A value of `size` bits, of which the lower half are the negative ones.
    #[inline(always)]
    const fn value(&mut self, size: u32) -> i32 {
        if size == 0 {
            return 0;
        }
        let raw = (self.bits >> (64 - size)) as i32;
        self.drop(size);
        if raw < 1 << (size - 1) { raw - (1 << size) + 1 } else { raw }
    }

    /// Difference of a block's mean from that of the block before.
    #[inline(always)]
    pub(super) fn mean(&mut self, table: &Huffman) -> Option<i32> {
        let size = self.symbol(table).filter(|&size| size <= 11)?;
        Some(self.value(size))
    }

    /// The other coefficients of a block, times their steps, at their places in natural order.
    #[inline(always)]
    pub(super) fn waves(&mut self, table: &Huffman, steps: &[u16; 64], block: &mut [i32; 64]) -> Option<()> {
        let mut k = 1;
        while k < 64 {
            let symbol = self.symbol(table)?;
            let (run, size) = ((symbol >> 4) as usize, symbol & 15);
            match (run, size) {
                (15, 0) => k += 16,
                (_, 0) => break,
                _ => {
                    k += run;
                    let (&place, &step) = (ZIGZAG.get(k)?, steps.get(k)?);
                    *block.get_mut(usize::from(place))? = self.value(size) * i32::from(step);
                    k += 1;
                }
            }
        }
        Some(())
    }

    /// Passes over the other coefficients of a block.
    #[inline(always)]
    pub(super) fn pass(&mut self, table: &Huffman) -> Option<()> {
        let mut k = 1;
        while k < 64 {
            let symbol = self.symbol(table)?;
            let (run, size) = (symbol >> 4, symbol & 15);
            if size == 0 && run < 15 {
                break;
            }
            self.drop(size);
            k += run + 1;
        }
        Some(())
    }

    /// Goes on behind the next restart marker; `None` if there is none.
    pub(super) fn restart(&mut self) -> Option<()> {
        let marker = self.rest.windows(2).position(|pair| matches!(pair, [0xFF, 0xD0..=0xD7]))?;
        *self = Self::new(self.rest.get(marker + 2..)?);
        Some(())
    }
}
