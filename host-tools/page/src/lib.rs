//! Tactus in a browser: a simulated probe, [`Session`], one at a line, [`Remote`], and [`OwnFiles`], as WebAssembly,
//! asked in JSON.
//!
//! Seven functions and the module's memory are the whole interface, so that neither wasm-bindgen nor its command is
//! needed: the page writes a request where [`request`] says, calls [`ask`], [`remote`] or [`own`], and reads the reply
//! where [`reply`] says. The module imports nothing.

use std::cell::RefCell;

use tactus_lab::live::{OwnFiles, Session};
use tactus_lab::remote::Remote;

#[derive(Default)]
struct Page {
    session: Session,
    remote: Remote,
    own: OwnFiles,
    request: Vec<u8>,
    reply: String,
}

thread_local! {
    static PAGE: RefCell<Page> = RefCell::default();
}

/// Where a request of so many bytes is to be written.
#[unsafe(no_mangle)]
pub extern "C" fn request(length: usize) -> *mut u8 {
    PAGE.with_borrow_mut(|page| {
        page.request.clear();
        page.request.resize(length, 0);
        page.request.as_mut_ptr()
    })
}

/// The request's bytes are the trials that the world of the page was learned from: they lie beside the module.
#[unsafe(no_mangle)]
pub extern "C" fn world() {
    PAGE.with_borrow_mut(|page| tactus_lab::live::bring_world(std::mem::take(&mut page.request)));
}

/// Has the simulated probe do what the request asks for: the bytes of the reply.
#[unsafe(no_mangle)]
pub extern "C" fn ask() -> usize {
    PAGE.with_borrow_mut(|page| {
        let request = String::from_utf8_lossy(&page.request);
        page.reply = page.session.ask(&request);
        page.reply.len()
    })
}

/// The same for the probe at a line.
#[unsafe(no_mangle)]
pub extern "C" fn remote() -> usize {
    PAGE.with_borrow_mut(|page| {
        let request = String::from_utf8_lossy(&page.request);
        page.reply = page.remote.ask(&request);
        page.reply.len()
    })
}

/// The request's bytes are the path of a file, which has so many, and then the file: one of the user's own.
#[unsafe(no_mangle)]
pub extern "C" fn file(path_length: usize) {
    PAGE.with_borrow_mut(|page| page.own.take(path_length, &page.request));
}

/// The same as [`ask`] for the user's own files.
#[unsafe(no_mangle)]
pub extern "C" fn own() -> usize {
    PAGE.with_borrow_mut(|page| {
        let request = String::from_utf8_lossy(&page.request);
        page.reply = page.own.ask(&request);
        page.reply.len()
    })
}

/// Where the reply is, until the next request.
#[unsafe(no_mangle)]
pub extern "C" fn reply() -> *const u8 {
    PAGE.with_borrow(|page| page.reply.as_ptr())
}
