//! A part of a JPEG frame, for those who look at one place of many frames.
//!
//! Huffman codes depend on those before, so what lies above the part and beside it is read too, but passed over: it is not transformed, and what
//! lies below is not read. Baseline JPEG with interleaved luma and chroma is understood, as webcams send it; of anything else, and of damage,
//! nothing comes back, and whoever asked decodes the whole frame in the usual way.

mod entropy;
mod transform;

use std::ops::Range;
use std::sync::LazyLock;

use fearless_simd::{Level, Simd, dispatch};
use image::RgbImage;

use entropy::{Huffman, Scan};

static LEVEL: LazyLock<Level> = LazyLock::new(Level::new);

/// Huffman tables by their number.
type Tables = [Option<Huffman>; 4];
const NO_TABLES: Tables = [const { None }; 4];

/// A rectangle of a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Columns [px].
    pub columns: Range<u32>,
    /// Rows [px].
    pub rows: Range<u32>,
}

/// The frame with the pixels of `part`; those outside it are black or right.
pub(super) fn decode(bytes: &[u8], part: &Part) -> Option<RgbImage> {
    let header = Header::read(bytes)?;
    let [width, height] = header.size;
    let mut image = RgbImage::new(width, height);
    let clipped = |range: &Range<u32>, end: u32| range.start.min(end)..range.end.min(end);
    let part = Part { columns: clipped(&part.columns, width), rows: clipped(&part.rows, height) };
    if !part.columns.is_empty() && !part.rows.is_empty() {
        let planes = dispatch!(*LEVEL, simd => header.planes(simd, &part))?;
        dispatch!(*LEVEL, simd => planes.paint(simd, &part, &mut image));
    }
    Some(image)
}

/// A component: luma, or one of chroma.
struct Component {
    id: u8,
    /// Blocks of it in a unit, across and down.
    blocks: [u32; 2],
    steps: [u16; 64],
    mean: Huffman,
    waves: Huffman,
}

/// What stands before the data.
struct Header<'a> {
    size: [u32; 2],
    components: [Component; 3],
    restart_interval: u32,
    data: &'a [u8],
}

/// Samples of the units that the part lies in.
struct Planes {
    /// Pixels of luma to a sample of chroma, across and down.
    ratio: [u32; 2],
    /// Columns and rows of pixels that were decoded, from whole units.
    units: Part,
    /// Luma, chroma blue, chroma red.
    samples: [Vec<u8>; 3],
    /// Samples of chroma that the frame has.
    chroma_size: [u32; 2],
}

impl<'a> Header<'a> {
    fn read(bytes: &'a [u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(&[0xFF, 0xD8])?;
        let mut steps: [Option<[u16; 64]>; 4] = [None; 4];
        let (mut means, mut waves) = (NO_TABLES, NO_TABLES);
        let (mut frame, mut restart_interval) = (None, 0);
        loop {
            let [0xFF, kind, after @ ..] = rest else { return None };
            if *kind == 0xFF {
                rest = rest.get(1..)?;
                continue;
            }
            let length = usize::from(u16::from_be_bytes(*after.first_chunk()?));
            let mut segment = after.get(2..length)?;
            rest = after.get(length..)?;
            match kind {
                0xDB => {
                    while let [head @ 0..=3, table @ ..] = segment {
                        *steps.get_mut(usize::from(*head))? = Some(table.first_chunk::<64>()?.map(u16::from));
                        segment = table.get(64..)?;
                    }
                    if !segment.is_empty() {
                        return None;
                    }
                }
                0xC4 => {
                    while let [head, table @ ..] = segment {
                        let counts = table.first_chunk::<16>()?;
                        let end = 16 + counts.iter().map(|&count| usize::from(count)).sum::<usize>();
                        let tables = if head >> 4 == 0 { &mut means } else { &mut waves };
                        *tables.get_mut(usize::from(head & 15))? = Some(Huffman::new(counts, table.get(16..end)?)?);
                        segment = table.get(end..)?;
                    }
                }
                0xC0 => frame = Some(segment),
                0xDD => restart_interval = u16::from_be_bytes(*segment.first_chunk()?).into(),
                0xDA => {
                    let [8, h1, h0, w1, w0, 3, components @ ..] = frame? else { return None };
                    let [height, width] = [[*h1, *h0], [*w1, *w0]].map(|size| u32::from(u16::from_be_bytes(size)));
                    let [3, selectors @ ..] = segment else { return None };
                    let (selectors, &[0, 63, 0]) = selectors.split_first_chunk::<6>()? else { return None };
                    let component = |i: usize| {
                        let &[id, sampling, table] = components.as_chunks::<3>().0.get(i)?;
                        let &[selected, tables] = selectors.as_chunks::<2>().0.get(i)?;
                        let huffman = |tables: &Tables, index: u8| tables.get(usize::from(index))?.clone();
                        (id == selected).then_some(())?;
                        Some(Component {
                            id,
                            blocks: [sampling >> 4, sampling & 15].map(u32::from),
                            steps: (*steps.get(usize::from(table))?)?,
                            mean: huffman(&means, tables >> 4)?,
                            waves: huffman(&waves, tables & 15)?,
                        })
                    };
                    let components = [component(0)?, component(1)?, component(2)?];
                    let header = Self { size: [width, height], components, restart_interval, data: rest };
                    return header.is_usual().then_some(header);
                }
                // Comments and what applications add; Adobe's marker may tell of other colours.
                0xFE | 0xE0..=0xED | 0xEF => {}
                _ => return None,
            }
        }
    }

    /// Luma and chroma of JFIF, chroma at the same resolution, at half across, or at half both ways.
    fn is_usual(&self) -> bool {
        let [luma, blue, red] = &self.components;
        let named_rgb = [luma.id, blue.id, red.id] == *b"RGB";
        let ratio = [[1, 1], [2, 1], [2, 2]].contains(&luma.blocks) && blue.blocks == [1, 1] && red.blocks == [1, 1];
        let [width, height] = self.size;
        ratio && !named_rgb && (1..=super::pixels::LARGEST_SIDE).contains(&width) && (1..=super::pixels::LARGEST_SIDE).contains(&height)
    }

    #[inline(always)]
    fn planes<S: Simd>(&self, simd: S, part: &Part) -> Option<Planes> {
        let ratio = self.components[0].blocks;
        let unit = ratio.map(|blocks| 8 * blocks);
        // Chroma is interpolated from a sample beyond either end.
        let units_of = |range: &Range<u32>, k: usize| {
            let all = self.size[k].div_ceil(unit[k]);
            range.start.saturating_sub(ratio[k]) / unit[k]..(range.end + ratio[k]).div_ceil(unit[k]).min(all)
        };
        let (across, down) = (units_of(&part.columns, 0), units_of(&part.rows, 1));
        let in_all = self.size[0].div_ceil(unit[0]);
        let counts = [across.len(), down.len()];
        let widths = self.components.each_ref().map(|c| counts[0] * 8 * c.blocks[0] as usize);
        let mut samples = [0, 1, 2].map(|i| vec![0_u8; widths[i] * counts[1] * 8 * self.components[i].blocks[1] as usize]);
        let mut scan = Scan::new(self.data);
        let (mut means, mut since_restart) = ([0_i32; 3], 0);
        for y in 0..down.end {
            for x in 0..in_all {
                if self.restart_interval > 0 && since_restart == self.restart_interval {
                    scan.restart()?;
                    (means, since_restart) = ([0; 3], 0);
                }
                since_restart += 1;
                let wanted = down.contains(&y) && across.contains(&x);
                for (i, component) in self.components.iter().enumerate() {
                    let [blocks_across, blocks_down] = component.blocks;
                    for (v, u) in (0..blocks_down).flat_map(|v| (0..blocks_across).map(move |u| (v, u))) {
                        means[i] += scan.mean(&component.mean)?;
                        if !wanted {
                            scan.pass(&component.waves)?;
                            continue;
                        }
                        let mut block = [0; 64];
                        block[0] = means[i] * i32::from(component.steps[0]);
                        scan.waves(&component.waves, &component.steps, &mut block)?;
                        let left = 8 * ((x - across.start) * blocks_across + u) as usize;
                        let top = 8 * ((y - down.start) * blocks_down + v) as usize;
                        let values = transform::inverse_cosine(simd, &block);
                        let lines = samples[i].get_mut(top * widths[i]..)?.chunks_exact_mut(widths[i]);
                        for (line, values) in lines.zip(values.as_chunks::<8>().0) {
                            line.get_mut(left..left + 8)?.copy_from_slice(values);
                        }
                    }
                }
            }
        }
        Some(Planes {
            ratio,
            units: Part { columns: across.start * unit[0]..across.end * unit[0], rows: down.start * unit[1]..down.end * unit[1] },
            samples,
            chroma_size: [self.size[0].div_ceil(ratio[0]), self.size[1].div_ceil(ratio[1])],
        })
    }
}

impl Planes {
    /// Writes the part's pixels.
    #[inline(always)]
    fn paint<S: Simd>(&self, _: S, part: &Part, image: &mut RgbImage) {
        let width = image.width() as usize;
        let luma_width = self.units.columns.len();
        let columns = (part.columns.start - self.units.columns.start) as usize..(part.columns.end - self.units.columns.start) as usize;
        let mut chroma = [Vec::new(), Vec::new()];
        let mut weighted = Vec::new();
        let rows = image.chunks_exact_mut(3 * width).enumerate().skip(part.rows.start as usize).take(part.rows.len());
        for (y, row) in rows {
            let y = y as u32;
            for (chroma, plane) in chroma.iter_mut().zip(&self.samples[1..]) {
                self.chroma_row(plane, y, &mut weighted, chroma);
            }
            let start = (y - self.units.rows.start) as usize * luma_width;
            let luma = self.samples[0].get(start..start + luma_width).unwrap_or_default();
            let [blue, red] = &chroma;
            let planes = [luma, blue, red].map(|line| line.get(columns.clone()).unwrap_or_default());
            let pixels = row.get_mut(3 * part.columns.start as usize..).unwrap_or_default().as_chunks_mut().0;
            for (pixel, ((&luma, &blue), &red)) in pixels.iter_mut().zip(planes[0].iter().zip(planes[1]).zip(planes[2])) {
                *pixel = transform::rgb(luma, blue, red);
            }
        }
    }

    /// Chroma of a row of pixels, as far as its units reach.
    #[inline(always)]
    fn chroma_row(&self, plane: &[u8], y: u32, weighted: &mut Vec<i32>, out: &mut Vec<u8>) {
        let width = self.units.columns.len() / self.ratio[0] as usize;
        let first = self.units.rows.start / self.ratio[1];
        let line = |row: u32| plane.chunks_exact(width).nth((row - first) as usize).unwrap_or_default();
        // Samples beyond the frame's edge are padding: the last one in it is repeated.
        let within = (self.chroma_size[0] - self.units.columns.start / self.ratio[0]) as usize;
        let here = y / self.ratio[1];
        weighted.clear();
        match self.ratio {
            [1, 1] => {
                out.clear();
                out.extend_from_slice(line(here));
            }
            [_, 1] => {
                weighted.extend(line(here).iter().take(within).map(|&value| i32::from(value)));
                transform::double(weighted, 2, out);
            }
            _ => {
                let last = self.chroma_size[1] - 1;
                let other = if y.is_multiple_of(2) { here.saturating_sub(1) } else { (here + 1).min(last) };
                let both = line(here).iter().zip(line(other)).take(within);
                weighted.extend(both.map(|(&near, &far)| 3 * i32::from(near) + i32::from(far)));
                transform::double(weighted, 4, out);
            }
        }
    }
}

#[cfg(test)]
mod tests;
