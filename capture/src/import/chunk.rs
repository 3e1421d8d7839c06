//! The compressions of a bag's chunks: none, bzip2, and LZ4 in its frame format.

use std::io::Read;

use super::bag::BagFault;

/// Largest chunk: rosbag's have 768 kB unless it is told otherwise, and a few bytes can be said to unpack to anything.
const LARGEST: u32 = 1 << 29;

/// The records of a chunk, which must be of the size that its header says.
///
/// # Errors
/// If the compression is another one, or the bytes are not of it or not as many.
pub fn unpack(compression: &str, size: u32, data: &[u8]) -> Result<Vec<u8>, BagFault> {
    if size > LARGEST {
        return Err(BagFault::Malformed(format!("a chunk is said to have {size} bytes, and {LARGEST} is the most that is unpacked")));
    }
    // One byte more than is said tells a chunk that is too long without unpacking all of it.
    let limit = u64::from(size) + 1;
    let mut records = Vec::new();
    match compression {
        "none" => data.take(limit).read_to_end(&mut records)?,
        "bz2" => bzip2::read::BzDecoder::new(data).take(limit).read_to_end(&mut records)?,
        "lz4" => lz4_flex::frame::FrameDecoder::new(data).take(limit).read_to_end(&mut records)?,
        other => return Err(BagFault::Malformed(format!("the compression `{other}` of a chunk is none of none, bz2 and lz4"))),
    };
    if records.len() as u64 == u64::from(size) {
        return Ok(records);
    }
    Err(BagFault::Malformed(format!("a chunk has {} bytes where its header says {size}", records.len())))
}
