//! What the webcam says it is (USB Video Class 1.0, chapter 3): a camera terminal, a processing unit, an output terminal, and a stream with two
//! formats over a bulk endpoint.

/// Columns and rows of both formats (px).
pub const SIZE_PX: [u16; 2] = [640, 480];
/// Bytes of a YUYV frame, which is larger than any JPEG sent.
pub const FRAME_BYTES: u32 = 640 * 480 * 2;
/// Largest payload with its header.
pub const PAYLOAD_BYTES: u32 = 16_384;
/// Intervals that can be chosen (100 ns).
pub const INTERVALS: [u32; 3] = [666_666, 333_333, 166_666];
/// Indices of the formats.
pub const MJPG: u8 = 1;
/// See [`MJPG`].
pub const YUYV: u8 = 2;
/// The camera terminal's number, and the processing unit's.
pub const CAMERA: u8 = 1;
/// See [`CAMERA`].
pub const PROCESSING: u8 = 3;

/// Device descriptor: a device with interface association, vendor and product of the Linux Foundation.
pub fn device() -> Vec<u8> {
    vec![18, 1, 0, 2, 0xEF, 2, 1, 64, 0x6b, 0x1d, 0x02, 0x01, 0, 1, 1, 2, 3, 1]
}

/// String descriptor.
pub fn string(text: &str) -> Vec<u8> {
    let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    [&[units.len() as u8 + 2, 3], units.as_slice()].concat()
}

/// Configuration with all its interfaces.
pub fn configuration() -> Vec<u8> {
    // Exposure mode, priority and time; focus and its automatic.
    let camera = [18, 0x24, 2, CAMERA, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0b10_1110, 0, 0b10];
    // White balance and its automatic.
    let processing = [12, 0x24, 5, PROCESSING, CAMERA, 0, 0, 2, 0b0100_0000, 0b1_0000, 0, 0];
    let output = [9, 0x24, 3, 2, 0x01, 0x01, 0, PROCESSING, 0];
    let units = [camera.as_slice(), &processing, &output].concat();
    let control =
        [&[13, 0x24, 1, 0x00, 0x01], (13 + units.len() as u16).to_le_bytes().as_slice(), &48_000_000_u32.to_le_bytes(), &[1, 1], &units]
            .concat();

    let colours = [6, 0x24, 0x0D, 1, 1, 4];
    let mjpg = [&[11, 0x24, 6, MJPG, 1, 1, 1, 0, 0, 0, 0], frame(7).as_slice(), &colours].concat();
    let guid = *b"YUY2\x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71";
    let yuyv = [&[27, 0x24, 4, YUYV, 1], guid.as_slice(), &[16, 1, 0, 0, 0, 0], &frame(5), &colours].concat();
    let formats = [mjpg, yuyv].concat();
    let header = [&[15, 0x24, 1, 2], (15 + formats.len() as u16).to_le_bytes().as_slice(), &[0x81, 0, 2, 0, 0, 0, 1, 0, 0]].concat();

    let interfaces = [
        &[8, 0x0B, 0, 2, 0x0E, 3, 0, 2],
        [9, 4, 0, 0, 0, 0x0E, 1, 0, 0].as_slice(),
        &control,
        &[9, 4, 1, 0, 1, 0x0E, 2, 0, 0],
        &header,
        &formats,
        &[7, 5, 0x81, 2, 0x00, 0x02, 0],
    ]
    .concat();
    [&[9, 2], (9 + interfaces.len() as u16).to_le_bytes().as_slice(), &[2, 1, 0, 0x80, 250], &interfaces].concat()
}

fn frame(kind: u8) -> Vec<u8> {
    let [width, height] = SIZE_PX.map(u16::to_le_bytes);
    let [slowest, fastest] = [15, 60].map(|rate_hz| (FRAME_BYTES * 8 * rate_hz).to_le_bytes());
    let intervals: Vec<u8> = INTERVALS.iter().flat_map(|interval| interval.to_le_bytes()).collect();
    let usual = INTERVALS[1].to_le_bytes();
    let length = (26 + intervals.len()) as u8;
    let numbers = [slowest, fastest, FRAME_BYTES.to_le_bytes(), usual].concat();
    [&[length, 0x24, kind, 1, 0], width.as_slice(), &height, &numbers, &[INTERVALS.len() as u8], &intervals].concat()
}

/// What the stream is negotiated to: format and interval.
pub fn probe(format: u8, interval: u32) -> Vec<u8> {
    let sizes = [FRAME_BYTES.to_le_bytes(), PAYLOAD_BYTES.to_le_bytes()].concat();
    [&[1, 0, format, 1], interval.to_le_bytes().as_slice(), &[0; 10], &sizes].concat()
}
