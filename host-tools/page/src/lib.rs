//! Tactus in a browser: [`Session`] as WebAssembly, asked in JSON.
//!
//! Three functions and the module's memory are the whole interface, so that neither wasm-bindgen nor its command is needed: the page
//! writes a request where [`request`] says, calls [`ask`], and reads the reply where [`reply`] says. The module imports nothing.

use std::cell::RefCell;

use tactus::live::Session;

#[derive(Default)]
struct Page {
    session: Session,
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

/// Does what the request asks for: the bytes of the reply.
#[unsafe(no_mangle)]
pub extern "C" fn ask() -> usize {
    PAGE.with_borrow_mut(|page| {
        let request = String::from_utf8_lossy(&page.request);
        page.reply = page.session.ask(&request);
        page.reply.len()
    })
}

/// Where the reply is, until the next request.
#[unsafe(no_mangle)]
pub extern "C" fn reply() -> *const u8 {
    PAGE.with_borrow(|page| page.reply.as_ptr())
}
