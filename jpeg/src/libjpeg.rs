//! The few calls to libjpeg-turbo, so that nothing outside can call them in a wrong order or with a buffer that is too small.
//!
//! The library reports errors by a callback that must not return. Here it unwinds through the library's frames, which are compiled for that, to
//! [`catch`].

use std::ffi::c_int;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use mozjpeg_sys::{
    J_COLOR_SPACE, jpeg_common_struct, jpeg_create_decompress, jpeg_crop_scanline, jpeg_decompress_struct, jpeg_destroy_decompress,
    jpeg_error_mgr, jpeg_mem_src, jpeg_read_header, jpeg_read_scanlines, jpeg_skip_scanlines, jpeg_start_decompress, jpeg_std_error,
};

/// What the library's callbacks unwind with.
struct Objection;

/// What `decode` returns; `None` if the library objected to something.
pub(crate) fn catch<T>(decode: impl FnOnce() -> Option<T>) -> Option<T> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|objection| {
        if !objection.is::<Objection>() {
            resume_unwind(objection);
        }
        None
    })
}

extern "C-unwind" fn object(_: &mut jpeg_common_struct) {
    resume_unwind(Box::new(Objection));
}

/// Levels below 0 are warnings of damage, others tell what is going on.
extern "C-unwind" fn object_to_damage(common: &mut jpeg_common_struct, level: c_int) {
    if level < 0 {
        object(common);
    }
}

/// What the library works on, at one place in memory as each points to the other.
struct State {
    info: jpeg_decompress_struct,
    errors: jpeg_error_mgr,
}

/// A file whose header has been read, before or while its rows are. All of its methods may only be called within [`catch`].
pub(crate) struct Decoder<'b> {
    /// Of a box, which this owns. A pointer, as the library keeps pointers into it.
    state: *mut State,
    bytes: PhantomData<&'b [u8]>,
}

impl<'b> Decoder<'b> {
    /// Reads the header, for pixels in red, green and blue.
    pub(crate) fn start(bytes: &'b [u8]) -> Option<Self> {
        // SAFETY: both are C structures of numbers, enumerations that have a 0, and pointers that may be null.
        let state = Box::into_raw(Box::new(unsafe { MaybeUninit::<State>::zeroed().assume_init() }));
        let decoder = Self { state, bytes: PhantomData };
        // SAFETY: the state is at its place until `drop`, and `bytes` are borrowed as long. The calls are in the order of the library's manual,
        // the errors' callbacks first. They unwind, for which the feature `unwinding` of the library's crate is.
        unsafe {
            let State { info, errors } = &mut *state;
            info.common.err = jpeg_std_error(errors);
            errors.error_exit = Some(object);
            errors.emit_message = Some(object_to_damage);
            jpeg_create_decompress(info);
            jpeg_mem_src(info, bytes.as_ptr(), bytes.len().try_into().ok()?);
            jpeg_read_header(info, 1);
            info.out_color_space = J_COLOR_SPACE::JCS_RGB;
            jpeg_start_decompress(info);
        }
        (decoder.info().output_components == 3).then_some(decoder)
    }

    fn info(&self) -> &jpeg_decompress_struct {
        // SAFETY: the state is alive until `drop`, and what the library changes, it changes in methods that borrow the decoder alone.
        unsafe { &(*self.state).info }
    }

    /// Width and height, or what is left of them [px].
    pub(crate) fn size(&self) -> [u32; 2] {
        [self.info().output_width, self.info().output_height]
    }

    /// Leaves out all other columns, before the first row is read. Returns those that are read: more on the left where chroma is for many pixels.
    pub(crate) fn crop(&mut self, columns: Range<u32>) -> Range<u32> {
        let (mut start, mut width) = (columns.start, columns.end - columns.start);
        // SAFETY: as for `start`; columns outside of the image are an objection.
        unsafe { jpeg_crop_scanline(&mut (*self.state).info, &mut start, &mut width) };
        start..start + width
    }

    /// Leaves out the next rows.
    pub(crate) fn skip(&mut self, rows: u32) {
        // SAFETY: as for `start`; the library stops at the image's end.
        unsafe { jpeg_skip_scanlines(&mut (*self.state).info, rows) };
    }

    /// Decodes the next row into red, green and blue of its columns; `None` if there is none.
    pub(crate) fn read(&mut self, row: &mut [u8]) -> Option<()> {
        let needed = 3 * self.info().output_width as usize;
        let row = row.get_mut(..needed)?;
        // SAFETY: as for `start`; one row is asked for, of three components, which has room.
        let read = unsafe { jpeg_read_scanlines(&mut (*self.state).info, [row.as_mut_ptr()].as_mut_ptr(), 1) };
        (read == 1).then_some(())
    }
}

impl Drop for Decoder<'_> {
    fn drop(&mut self) {
        // SAFETY: the state came from a box in `start` and is dropped once. What the library could not set up is null, which it leaves.
        unsafe {
            jpeg_destroy_decompress(&mut (*self.state).info);
            drop(Box::from_raw(self.state));
        }
    }
}
