//! The handler that XLA calls in compiled functions of JAX: XLA's FFI in C (`xla/ffi/api/c_api.h`), as far as it is needed here.
//!
//! The layouts are those of version 0.1, to which later minor versions have only added fields at the ends. Each struct states its size.

#![allow(unsafe_code)]

use std::{
    ffi::{CString, c_char, c_int, c_void},
    mem::offset_of,
    panic::{AssertUnwindSafe, catch_unwind},
    ptr::{self, NonNull},
};

use pyo3::{prelude::*, types::PyCapsule};

use crate::{
    arrays::{Array, Float, Floats},
    function::Known,
    guard::message,
    kind::{Call, Order},
};

/// The versions that this was written for.
const MAJOR: c_int = 0;
const MINOR_FROM: c_int = 1;
const MINOR_TO: c_int = 3;

const EXTENSION_METADATA: c_int = 1;
const STAGE_EXECUTE: c_int = 3;
const BUFFER: c_int = 1;
const S32: c_int = 4;
const F32: c_int = 11;
const F64: c_int = 12;
const INVALID_ARGUMENT: c_int = 3;

#[repr(C)]
struct Extension {
    struct_size: usize,
    kind: c_int,
    next: *mut Extension,
}

#[repr(C)]
struct Version {
    struct_size: usize,
    extension_start: *mut Extension,
    major: c_int,
    minor: c_int,
}

#[repr(C)]
struct Metadata {
    struct_size: usize,
    api_version: Version,
    traits: u32,
}

#[repr(C)]
struct MetadataExtension {
    base: Extension,
    metadata: *mut Metadata,
}

/// An error that belongs to XLA.
#[repr(C)]
pub(crate) struct Error {
    _opaque: [u8; 0],
}

#[repr(C)]
struct ErrorCreate {
    struct_size: usize,
    extension_start: *mut Extension,
    message: *const c_char,
    code: c_int,
}

#[repr(C)]
struct Api {
    struct_size: usize,
    extension_start: *mut Extension,
    api_version: Version,
    internal_api: *const c_void,
    error_create: Option<unsafe extern "C" fn(*mut ErrorCreate) -> *mut Error>,
}

#[repr(C)]
struct Buffer {
    struct_size: usize,
    extension_start: *mut Extension,
    dtype: c_int,
    data: *mut c_void,
    rank: i64,
    dims: *const i64,
}

/// Arguments or results.
#[repr(C)]
struct Buffers {
    struct_size: usize,
    extension_start: *mut Extension,
    size: i64,
    types: *const c_int,
    buffers: *const *const Buffer,
}

#[repr(C)]
struct CallFrame {
    struct_size: usize,
    extension_start: *mut Extension,
    api: *const Api,
    context: *mut c_void,
    stage: c_int,
    arguments: Buffers,
    results: Buffers,
}

/// The handler that `jax.ffi.register_ffi_target` takes, as a capsule. The first argument of a call is settings, four int64 as int32 `[8]`: the `id`
/// of a function, the place of the derivative among "value", "image", "jvp", "vjp" and "vjp_of_vjp", and `along` and `wanted`, a bit for each flag, the
/// lowest first.
#[pyfunction]
pub(crate) fn xla_handler(py: Python<'_>) -> PyResult<Bound<'_, PyCapsule>> {
    let handler: unsafe extern "C" fn(*mut CallFrame) -> *mut Error = handle;
    let pointer = NonNull::new(handler as *mut c_void).expect("a function has an address");
    // SAFETY: the function lives as long as the library, which Python never unloads.
    unsafe { PyCapsule::new_with_pointer(py, pointer, c"xla._CUSTOM_CALL_TARGET") }
}

/// Answers a call: null, or an error.
unsafe extern "C" fn handle(frame: *mut CallFrame) -> *mut Error {
    // SAFETY: XLA calls with a frame that it owns, and that nobody else uses until this returns.
    let frame = unsafe { &*frame };
    let answer = AssertUnwindSafe(|| unsafe { answer(frame) });
    let why = match catch_unwind(answer) {
        Ok(Ok(())) => return ptr::null_mut(),
        Ok(Err(why)) => why,
        Err(panic) => message(&*panic),
    };
    // SAFETY: the interface is one of XLA's, and outlives the call.
    unsafe { error(frame.api, &why) }
}

/// # Safety
///
/// `frame` must be one of XLA's.
unsafe fn answer(frame: &CallFrame) -> Result<(), String> {
    at_least(frame.struct_size, size_of::<CallFrame>())?;
    // SAFETY: null or XLA's interface.
    let api = unsafe { frame.api.as_ref() };
    // SAFETY: an extension is null or a struct of XLA's.
    if let Some(extension) = unsafe { frame.extension_start.as_ref() }
        && extension.kind == EXTENSION_METADATA
    {
        if extension.struct_size >= size_of::<MetadataExtension>() {
            // SAFETY: its kind and its size say what it is.
            let extension = unsafe { &*frame.extension_start.cast::<MetadataExtension>() };
            describe(unsafe { &mut *extension.metadata }, api);
        }
        return Ok(());
    }
    let Some(Version { major: MAJOR, .. }) = api.map(|api| &api.api_version) else {
        return Err(format!("XLA's interface has another major version, expected {MAJOR}"));
    };
    if frame.stage != STAGE_EXECUTE {
        return Err(format!("XLA calls in stage {}, expected {STAGE_EXECUTE}", frame.stage));
    }
    // SAFETY: arguments and results are valid while a call executes, and results are written by nobody else.
    unsafe { execute(frame) }
}

/// States the version of the interface that this file implements: the latest that both sides know. XLA refuses a handler that states none.
fn describe(metadata: &mut Metadata, api: Option<&Api>) {
    if metadata.struct_size < offset_of!(Metadata, traits) + size_of::<u32>() {
        return;
    }
    // Older versions do not hand their interface over here; they know the first one.
    let minor = api.map_or(MINOR_FROM, |api| api.api_version.minor);
    metadata.api_version = Version {
        struct_size: size_of::<Version>(),
        extension_start: ptr::null_mut(),
        major: MAJOR,
        minor: minor.min(MINOR_TO),
    };
    metadata.traits = 0;
}

/// # Safety
///
/// `frame` must be one of XLA's that executes.
unsafe fn execute(frame: &CallFrame) -> Result<(), String> {
    // SAFETY: the caller's.
    let (arguments, results) = unsafe { (buffers(&frame.arguments)?, buffers(&frame.results)?) };
    let (first, arguments) = arguments.split_first().ok_or("a call has no settings")?;
    // SAFETY: the caller's.
    let [id, place, along, wanted] = unsafe { settings(first)? };
    let function = Known::find(id).ok_or(
        "the renderer of a compiled function is gone, or is of another process: compile it again, and keep the renderer as long",
    )?;
    let place = usize::try_from(place).ok();
    let (_, order) =
        place.and_then(|place| Order::ALL.get(place)).ok_or("there is no such derivative")?;
    let [count_along, count_wanted] = function.flags(*order);
    let flags = |bits: i64, count: usize| (0..count).map(|k| (bits >> k) & 1 == 1).collect();
    let along: Vec<bool> = flags(along, count_along);
    let wanted: Vec<bool> = flags(wanted, count_wanted);
    // SAFETY: XLA's buffers have the lengths that their shapes say, and arguments stay as they are while this runs.
    let arrays: Vec<_> =
        arguments.iter().map(|buffer| unsafe { array(buffer) }).collect::<Result<_, _>>()?;
    let call = Call { order: *order, along: &along, wanted: &wanted };
    let found = function.call(&call, &arrays)?;
    if found.len() != results.len() {
        let (found, expected) = (found.len(), results.len());
        return Err(format!("the function has {found} results, XLA expects {expected}"));
    }
    for (found, buffer) in found.iter().zip(results) {
        // SAFETY: as above; results overlap no arguments, since no call states that they may.
        unsafe {
            match &found.numbers {
                Floats::F32(values) => write(values, &found.dims, buffer, F32)?,
                Floats::F64(values) => write(values, &found.dims, buffer, F64)?,
                Floats::Device(_) => unreachable!("results of arrays of the host"),
            }
        }
    }
    Ok(())
}

/// # Safety
///
/// `buffer` must be XLA's.
unsafe fn settings(buffer: &Buffer) -> Result<[i64; 4], String> {
    // SAFETY: the caller's.
    if buffer.dtype != S32 || unsafe { dims(buffer)? } != [8] {
        return Err("the first argument of a call must be its settings, int32 [8]".to_owned());
    }
    let words = numbers::<i32>(buffer, 8)?;
    // SAFETY: eight numbers of 32 bits are four of 64.
    Ok(unsafe { words.cast::<[i64; 4]>().read_unaligned() })
}

/// # Safety
///
/// `all` must be XLA's.
unsafe fn buffers(all: &Buffers) -> Result<Vec<&Buffer>, String> {
    at_least(all.struct_size, size_of::<Buffers>())?;
    let one = |k: usize| {
        // SAFETY: there are `size` types and buffers.
        let (kind, buffer) = unsafe { (*all.types.add(k), *all.buffers.add(k)) };
        if kind != BUFFER {
            return Err(format!("argument or result {k} is no array"));
        }
        // SAFETY: its kind says that it is a buffer.
        let buffer = unsafe { &*buffer };
        at_least(buffer.struct_size, size_of::<Buffer>())?;
        Ok(buffer)
    };
    (0..count(all.size)?).map(one).collect()
}

/// # Safety
///
/// `buffer` must be XLA's.
unsafe fn dims(buffer: &Buffer) -> Result<Vec<usize>, String> {
    // SAFETY: there are `rank` lengths.
    (0..count(buffer.rank)?).map(|k| count(unsafe { *buffer.dims.add(k) })).collect()
}

/// # Safety
///
/// `buffer` must be XLA's, and its numbers must stay as they are for `'a`.
unsafe fn array<'a>(buffer: &'a Buffer) -> Result<Array<'a>, String> {
    // SAFETY: the caller's.
    unsafe {
        let dims = dims(buffer)?;
        let length = dims.iter().product();
        let numbers = match buffer.dtype {
            F32 => f32::any(&*numbers::<f32>(buffer, length)?),
            F64 => f64::any(&*numbers::<f64>(buffer, length)?),
            other => {
                return Err(format!(
                    "an array must be float32 or float64, found XLA's type {other}"
                ));
            }
        };
        Ok(Array { dims, numbers })
    }
}

/// The numbers of a buffer.
fn numbers<F>(buffer: &Buffer, length: usize) -> Result<*mut [F], String> {
    let data = match length {
        0 => NonNull::dangling().as_ptr(),
        _ => buffer.data.cast::<F>(),
    };
    if data.is_null() || !data.is_aligned() {
        return Err("an array has no numbers, or lies askew".to_owned());
    }
    Ok(ptr::slice_from_raw_parts_mut(data, length))
}

/// # Safety
///
/// `buffer` must be one that XLA wants to be written.
unsafe fn write<F: Copy>(
    values: &[F],
    shape: &[usize],
    buffer: &Buffer,
    dtype: c_int,
) -> Result<(), String> {
    // SAFETY: the caller's.
    let expected = unsafe { dims(buffer)? };
    if expected != shape || buffer.dtype != dtype {
        return Err(format!(
            "a result is {shape:?} of XLA's type {dtype}, expected {expected:?} of {}",
            buffer.dtype
        ));
    }
    // SAFETY: the caller's; the shape says how many numbers there are.
    unsafe { (*numbers::<F>(buffer, values.len())?).copy_from_slice(values) };
    Ok(())
}

/// An error with this message.
///
/// # Safety
///
/// `api` must be XLA's.
unsafe fn error(api: *const Api, why: &str) -> *mut Error {
    let message = CString::new(why.replace('\0', " ")).unwrap_or_default();
    let mut create = ErrorCreate {
        struct_size: size_of::<ErrorCreate>(),
        extension_start: ptr::null_mut(),
        message: message.as_ptr(),
        code: INVALID_ARGUMENT,
    };
    // SAFETY: the caller's; XLA copies the message.
    unsafe {
        let usable = api.as_ref().filter(|api| api.struct_size >= size_of::<Api>());
        match usable.and_then(|api| api.error_create) {
            Some(error_create) => error_create(&mut create),
            // To return would mean that all went well.
            None => std::process::abort(),
        }
    }
}

fn at_least(size: usize, expected: usize) -> Result<(), String> {
    if size >= expected {
        return Ok(());
    }
    Err(format!("XLA's interface is another one: a struct of {size} bytes, expected {expected}"))
}

fn count(size: i64) -> Result<usize, String> {
    usize::try_from(size).map_err(|_| format!("XLA states a length of {size}"))
}
