//! Large arrays on huge pages: the kernel maps 2 MiB at a time instead of 4 KiB. Maps of 12 megapixels are 48 MB each; mapping
//! them page by page took a quarter of the CPU time of `farnear depth`.
#![allow(unsafe_code)] // an allocator and madvise; each block states why it is sound.

use std::alloc::{GlobalAlloc, Layout, System};

/// Size from which an allocation gets huge pages; two of them at least.
const LARGE: usize = 4 << 20;
/// Multiple of the page size of any supported processor.
const PAGE: usize = 64 << 10;

/// The system's allocator with [`LARGE`] allocations on huge pages where the kernel has them to give.
pub(crate) struct HugePages;

// SAFETY: every call goes to the system's allocator with the caller's arguments; advice changes no contents.
unsafe impl GlobalAlloc for HugePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        advised(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        advised(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller's promise.
        advised(unsafe { System.realloc(at, layout, size) }, size)
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(at, layout) }
    }
}

/// Advises the kernel on the whole pages of an allocation. A kernel without huge pages refuses, which is no error.
fn advised(at: *mut u8, size: usize) -> *mut u8 {
    if size >= LARGE && !at.is_null() {
        let skipped = at.addr().next_multiple_of(PAGE) - at.addr();
        // SAFETY: the range lies within the allocation, and the advice leaves its contents as they are.
        unsafe { libc::madvise(at.add(skipped).cast(), (size - skipped) / PAGE * PAGE, libc::MADV_HUGEPAGE) };
    }
    at
}
