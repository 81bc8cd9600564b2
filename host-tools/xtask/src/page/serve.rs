//! Serves a folder to this machine.
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

use anyhow::{Context as _, Result};

/// Types of the files by the ends of their names.
const TYPES: [(&str, &str); 6] = [
    ("html", "text/html; charset=utf-8"),
    ("css", "text/css; charset=utf-8"),
    ("js", "text/javascript; charset=utf-8"),
    ("svg", "image/svg+xml"),
    ("png", "image/png"),
    ("wasm", "application/wasm"),
];
/// A client that says nothing is not waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// Answers until somebody ends the program.
pub(super) fn serve(folder: &Path, port: u16) -> Result<()> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
        .with_context(|| format!("cannot listen at port {port}: another one with --port"))?;
    println!("http://{}/   (Ctrl-C ends it)", listener.local_addr()?);
    for client in listener.incoming() {
        // one that goes away in the middle is no reason to stop
        let _ = client.and_then(|client| answer(client, folder));
    }
    Ok(())
}

fn answer(mut client: TcpStream, folder: &Path) -> std::io::Result<()> {
    client.set_read_timeout(Some(PATIENCE))?;
    let mut request = String::new();
    BufReader::new(&client).read_line(&mut request)?;
    let (status, kind, body) = match found(&request, folder) {
        Some((kind, body)) => ("200 OK", kind, body),
        None => ("404 Not Found", "text/plain", b"not here\n".to_vec()),
    };
    let length = body.len();
    write!(
        client,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n"
    )?;
    client.write_all(&body)
}

/// The file that is asked for, and its type. Files lie in the folder itself, so a name with a path is none of them.
fn found(request: &str, folder: &Path) -> Option<(&'static str, Vec<u8>)> {
    let path = request.strip_prefix("GET /")?.split([' ', '?']).next()?;
    let name = if path.is_empty() { "index.html" } else { path };
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if !name.chars().all(plain) || name.starts_with('.') {
        return None;
    }
    let (_, end) = name.rsplit_once('.')?;
    let (_, kind) = TYPES.iter().find(|(known, _)| *known == end)?;
    Some((kind, std::fs::read(folder.join(name)).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_the_folder_have_their_types_and_others_are_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("page");
        std::fs::create_dir(&page).unwrap();
        std::fs::write(page.join("index.html"), "<p>").unwrap();
        std::fs::write(page.join("a.wasm"), "\0asm").unwrap();
        std::fs::write(folder.path().join("secret.html"), "x").unwrap();
        let kind = |request: &str| found(request, &page).map(|(kind, _)| kind);
        assert_eq!(kind("GET / HTTP/1.1"), Some("text/html; charset=utf-8"));
        assert_eq!(kind("GET /?a#b HTTP/1.1"), Some("text/html; charset=utf-8"));
        assert_eq!(kind("GET /a.wasm HTTP/1.1"), Some("application/wasm"));
        for request in [
            "GET /../secret.html HTTP/1.1",
            "GET //etc/passwd HTTP/1.1",
            "GET /none.html HTTP/1.1",
            "POST / HTTP/1.1",
            "",
        ] {
            assert_eq!(kind(request), None, "{request}");
        }
    }
}
