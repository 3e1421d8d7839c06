//! Baseline JPEG with half the columns of chroma, as webcams send it (ITU-T T.81, tables of its Annex K).
//!
//! The `image` crate's encoder keeps all chroma and takes most of the time of a rendered frame; this one takes a third of that.

use std::array::from_fn;

/// Columns and rows of the unit that is coded at once: two blocks of luma and one each of blue and red chroma.
const UNIT: [usize; 2] = [16, 8];

type Block = [[f32; 8]; 8];

/// An encoder for one quality from 1 to 100, as the Independent JPEG Group counts it.
#[derive(Debug)]
pub(crate) struct Encoder {
    /// Quantisation steps in zigzag order, luma and chroma.
    steps: [[u8; 64]; 2],
    /// What a transformed coefficient is multiplied by, row by row.
    scales: [Block; 2],
    codes: [Codes; 2],
}

/// Code and length by symbol.
#[derive(Debug)]
struct Codes {
    dc: [(u16, u8); 256],
    ac: [(u16, u8); 256],
}

impl Encoder {
    pub(crate) fn new(quality: u8) -> Self {
        let quality = u32::from(quality.clamp(1, 100));
        let percent = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
        let steps = [LUMA, CHROMA]
            .map(|table| ZIGZAG.map(|place| ((u32::from(table[usize::from(place)]) * percent + 50) / 100).clamp(1, 255) as u8));
        let scales = steps.each_ref().map(|steps| {
            let mut scale = [[0.0; 8]; 8];
            for (step, &place) in steps.iter().zip(&ZIGZAG) {
                let (row, column) = (usize::from(place) / 8, usize::from(place) % 8);
                scale[row][column] = 1.0 / (f32::from(*step) * 8.0 * AAN[row] * AAN[column]);
            }
            scale
        });
        let codes = [
            Codes { dc: codes(&LUMA_DC, &DC_SYMBOLS), ac: codes(&LUMA_AC, &LUMA_AC_SYMBOLS) },
            Codes { dc: codes(&CHROMA_DC, &DC_SYMBOLS), ac: codes(&CHROMA_AC, &CHROMA_AC_SYMBOLS) },
        ];
        Self { steps, scales, codes }
    }

    /// The JPEG of rows of red, green, blue. Sides of at most 65535 px fit the format.
    pub(crate) fn encode(&self, rgb: &[u8], width: u16, height: u16) -> Vec<u8> {
        let mut out = Vec::with_capacity(rgb.len() / 16);
        self.header(&mut out, width, height);
        let mut bits = Bits { out, held: 0, count: 0 };
        let (columns, rows) = (usize::from(width), usize::from(height));
        let units = columns.div_ceil(UNIT[0]);
        let mut planes = Planes::new(units);
        let mut last = [0; 3];
        for top in (0..rows).step_by(UNIT[1]) {
            for line in 0..UNIT[1] {
                // Rows beyond the image repeat its last one.
                let row = (top + line).min(rows - 1) * columns * 3;
                planes.fill(line, &rgb[row..row + columns * 3]);
            }
            for unit in 0..units {
                for block in [2 * unit, 2 * unit + 1] {
                    self.block(&mut bits, 0, &mut last[0], &planes.luma[block]);
                }
                for chroma in [0, 1] {
                    self.block(&mut bits, 1, &mut last[1 + chroma], &planes.chroma[chroma][unit]);
                }
            }
        }
        let mut out = bits.finish();
        out.extend([0xff, 0xd9]);
        out
    }

    fn header(&self, out: &mut Vec<u8>, width: u16, height: u16) {
        out.extend([0xff, 0xd8]);
        let mut segment = |marker: u8, parts: &[&[u8]]| {
            let length = 2 + parts.iter().map(|part| part.len()).sum::<usize>() as u16;
            out.extend([0xff, marker]);
            out.extend(length.to_be_bytes());
            parts.iter().for_each(|part| out.extend_from_slice(part));
        };
        let ([h0, h1], [w0, w1]) = (height.to_be_bytes(), width.to_be_bytes());
        segment(0xe0, &[b"JFIF\0", &[1, 1, 0, 0, 1, 0, 1, 0, 0]]);
        segment(0xdb, &[&[0], &self.steps[0], &[1], &self.steps[1]]);
        segment(0xc0, &[&[8, h0, h1, w0, w1, 3, 1, 0x21, 0, 2, 0x11, 1, 3, 0x11, 1]]);
        segment(0xc4, &[&[0x00], &LUMA_DC, &DC_SYMBOLS, &[0x10], &LUMA_AC, &LUMA_AC_SYMBOLS]);
        segment(0xc4, &[&[0x01], &CHROMA_DC, &DC_SYMBOLS, &[0x11], &CHROMA_AC, &CHROMA_AC_SYMBOLS]);
        segment(0xda, &[&[3, 1, 0x00, 2, 0x11, 3, 0x11, 0, 63, 0]]);
    }

    /// Transforms, quantises and codes a block; `last` is the mean of the one before.
    fn block(&self, bits: &mut Bits, table: usize, last: &mut i32, block: &Block) {
        let transformed = transform(&transform(block));
        let mut levels = [0; 64];
        for (levels, (values, scales)) in levels.as_chunks_mut::<8>().0.iter_mut().zip(transformed.iter().zip(&self.scales[table])) {
            *levels = from_fn(|i| nearest(values[i] * scales[i]));
        }
        let mut ordered = [0; 64];
        let mut left = 0_u64;
        for (k, &place) in ZIGZAG.iter().enumerate() {
            ordered[k] = levels[usize::from(place) & 63];
            left |= u64::from(ordered[k] != 0) << k;
        }
        let codes = &self.codes[table];
        let mean = ordered[0];
        let (size, value) = magnitude(mean - *last);
        *last = mean;
        bits.put(codes.dc[usize::from(size)]);
        bits.put((value, size));
        // One bit per level that is not zero: what lies between is skipped at once. The mean is done.
        left &= !1;
        let mut next = 1;
        while left != 0 {
            let place = left.trailing_zeros() as usize;
            left &= left - 1;
            let mut zeros = place - next;
            next = place + 1;
            while zeros > 15 {
                bits.put(codes.ac[0xf0]);
                zeros -= 16;
            }
            let (size, value) = magnitude(ordered[place]);
            bits.put(codes.ac[zeros << 4 | usize::from(size)]);
            bits.put((value, size));
        }
        if next < 64 {
            bits.put(codes.ac[0]);
        }
    }
}

/// The nearest whole number: a float of this size has no room for a fraction.
fn nearest(value: f32) -> i32 {
    const WHOLE: f32 = 12_582_912.0;
    (value + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32
}

/// Eight lines of luma and chroma about zero, block by block.
struct Planes {
    luma: Vec<Block>,
    chroma: [Vec<Block>; 2],
}

impl Planes {
    fn new(units: usize) -> Self {
        let blocks = |count| vec![[[0.0; 8]; 8]; count];
        Self { luma: blocks(2 * units), chroma: [blocks(units), blocks(units)] }
    }

    /// Takes one line of pixels; columns beyond the image repeat its last pixel.
    fn fill(&mut self, line: usize, rgb: &[u8]) {
        let [blue, red] = &mut self.chroma;
        let mut pieces = rgb.chunks(3 * UNIT[0]);
        for ((luma, blue), red) in self.luma.as_chunks_mut::<2>().0.iter_mut().zip(blue).zip(red) {
            let Some(piece) = pieces.next() else { break };
            let mut whole = [0; 3 * UNIT[0]];
            whole[..piece.len()].copy_from_slice(piece);
            for x in piece.len()..whole.len() {
                whole[x] = whole[x - 3];
            }
            let colour: [[f32; 16]; 3] = from_fn(|c| from_fn(|x| f32::from(whole[3 * x + c])));
            for (half, luma) in luma.iter_mut().enumerate() {
                luma[line] = from_fn(|x| {
                    let [r, g, b] = colour.each_ref().map(|values| values[8 * half + x]);
                    0.299 * r + 0.587 * g + 0.114 * b - 128.0
                });
            }
            let mean: [[f32; 8]; 3] = from_fn(|c| from_fn(|x| 0.5 * (colour[c][2 * x] + colour[c][2 * x + 1])));
            let [r, g, b] = &mean;
            blue[line] = from_fn(|x| -0.168_736 * r[x] - 0.331_264 * g[x] + 0.5 * b[x]);
            red[line] = from_fn(|x| 0.5 * r[x] - 0.418_688 * g[x] - 0.081_312 * b[x]);
        }
    }
}

/// Cosine transform of every column, then transposed; scaled by [`AAN`] (Arai, Agui, Nakajima 1988).
fn transform(d: &Block) -> Block {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let mut rows: Block = [[0.0; 8]; 8];
    for i in 0..8 {
        let (s0, s1, s2, s3) = (d[0][i] + d[7][i], d[1][i] + d[6][i], d[2][i] + d[5][i], d[3][i] + d[4][i]);
        let (d0, d1, d2, d3) = (d[0][i] - d[7][i], d[1][i] - d[6][i], d[2][i] - d[5][i], d[3][i] - d[4][i]);
        let (outer, inner, gap) = (s0 + s3, s1 + s2, s0 - s3);
        let turn = (s1 - s2 + gap) * half;
        let (a, b, c) = (d3 + d2, d2 + d1, d1 + d0);
        let shared = (a - c) * 0.382_683_43;
        let (low, high) = (a * 0.541_196_1 + shared, c * 1.306_563 + shared);
        let (plus, minus) = (d0 + b * half, d0 - b * half);
        rows[0][i] = outer + inner;
        rows[1][i] = plus + high;
        rows[2][i] = gap + turn;
        rows[3][i] = minus - low;
        rows[4][i] = outer - inner;
        rows[5][i] = minus + low;
        rows[6][i] = gap - turn;
        rows[7][i] = plus - high;
    }
    from_fn(|i| rows.map(|row| row[i]))
}

/// Number of bits of a value, and those bits: negative values count down from all ones.
fn magnitude(value: i32) -> (u8, u16) {
    let size = 32 - value.unsigned_abs().leading_zeros();
    let bits = if value < 0 { value + (1 << size) - 1 } else { value };
    (size as u8, bits as u16)
}

/// Bits on their way out.
struct Bits {
    out: Vec<u8>,
    held: u64,
    count: u32,
}

impl Bits {
    fn put(&mut self, (bits, length): (u16, u8)) {
        self.held = self.held << length | u64::from(bits);
        self.count += u32::from(length);
        while self.count >= 8 {
            self.count -= 8;
            let byte = (self.held >> self.count) as u8;
            self.out.push(byte);
            if byte == 0xff {
                self.out.push(0);
            }
        }
    }

    fn finish(mut self) -> Vec<u8> {
        // The last byte is filled up with ones.
        self.put((0x7f_u16, 7));
        self.out
    }
}

/// Codes of symbols, the shorter lengths first, from how many there are of each length from 1 to 16.
fn codes(counts: &[u8; 16], symbols: &[u8]) -> [(u16, u8); 256] {
    let mut table = [(0, 0); 256];
    let mut symbols = symbols.iter();
    let mut code = 0_u16;
    for (length, &count) in (1..).zip(counts) {
        for &symbol in symbols.by_ref().take(usize::from(count)) {
            table[usize::from(symbol)] = (code, length);
            code += 1;
        }
        code <<= 1;
    }
    table
}

/// Scale of the transform's rows and columns: `sqrt(2) cos(k pi / 16)`, 1 for the mean.
const AAN: [f32; 8] = [1.0, 1.387_039_8, 1.306_563, 1.175_875_6, 1.0, 0.785_694_96, 0.541_196_1, 0.275_899_38];

/// Places in a block, row by row, in the order of coding.
#[rustfmt::skip]
const ZIGZAG: [u8; 64] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7, 14, 21, 28,
    35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
];

/// Table K.1.
#[rustfmt::skip]
const LUMA: [u8; 64] = [
    16, 11, 10, 16, 24, 40, 51, 61,  12, 12, 14, 19, 26, 58, 60, 55,  14, 13, 16, 24, 40, 57, 69, 56,  14, 17, 22, 29, 51, 87, 80, 62,
    18, 22, 37, 56, 68, 109, 103, 77,  24, 35, 55, 64, 81, 104, 113, 92,  49, 64, 78, 87, 103, 121, 120, 101,  72, 92, 95, 98, 112, 100, 103, 99,
];

/// Table K.2.
#[rustfmt::skip]
const CHROMA: [u8; 64] = [
    17, 18, 24, 47, 99, 99, 99, 99,  18, 21, 26, 66, 99, 99, 99, 99,  24, 26, 56, 99, 99, 99, 99, 99,  47, 66, 99, 99, 99, 99, 99, 99,
    99, 99, 99, 99, 99, 99, 99, 99,  99, 99, 99, 99, 99, 99, 99, 99,  99, 99, 99, 99, 99, 99, 99, 99,  99, 99, 99, 99, 99, 99, 99, 99,
];

// Tables K.3 to K.6: how many codes there are of each length, and their symbols.
const DC_SYMBOLS: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
const LUMA_DC: [u8; 16] = [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0];
const CHROMA_DC: [u8; 16] = [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0];
const LUMA_AC: [u8; 16] = [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125];
const CHROMA_AC: [u8; 16] = [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 119];
#[rustfmt::skip]
const LUMA_AC_SYMBOLS: [u8; 162] = [
    0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22, 0x71, 0x14, 0x32, 0x81,
    0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18,
    0x19, 0x1a, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48,
    0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75,
    0x76, 0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99,
    0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3,
    0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5,
    0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
];
#[rustfmt::skip]
const CHROMA_AC_SYMBOLS: [u8; 162] = [
    0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13, 0x22, 0x32, 0x81, 0x08,
    0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33, 0x52, 0xf0, 0x15, 0x62, 0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25,
    0xf1, 0x17, 0x18, 0x19, 0x1a, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47,
    0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74,
    0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97,
    0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba,
    0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe2, 0xe3, 0xe4,
    0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
];
