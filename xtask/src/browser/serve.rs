//! Serves the files of a folder, and takes one report.

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::{TcpListener, TcpStream},
    path::Path,
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};

/// Kinds of files of a page.
const KINDS: [(&str, &str); 3] = [("html", "text/html"), ("js", "text/javascript"), ("wasm", "application/wasm")];

/// The path that reports are sent to.
const REPORT: &str = "report";

/// How long a connection may be silent.
const SILENCE: Duration = Duration::from_secs(10);

/// Serves `folder` without end.
pub(super) fn forever(listener: &TcpListener, folder: &Path) -> Result<bool> {
    loop {
        let (stream, _) = listener.accept().context("cannot accept a connection")?;
        // A browser that closes a connection ends only that.
        let _ = answer(stream, folder);
    }
}

/// Serves `folder` until a report arrives, and returns it. An error of `check`, which is called while nothing comes, ends the wait.
pub(super) fn until_reported(
    listener: &TcpListener,
    folder: &Path,
    patience: Duration,
    mut check: impl FnMut() -> Result<()>,
) -> Result<String> {
    listener.set_nonblocking(true).context("cannot wait for connections")?;
    let start = Instant::now();
    while start.elapsed() < patience {
        match listener.accept() {
            Ok((stream, _)) => {
                if let Ok(Some(report)) = answer(stream, folder) {
                    return Ok(report);
                }
            }
            Err(_) => {
                check()?;
                thread::sleep(Duration::from_millis(20));
            }
        }
    }
    bail!("the page reports nothing within {} s", patience.as_secs())
}

/// Answers one request; a report that it brings.
fn answer(stream: TcpStream, folder: &Path) -> Result<Option<String>> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(SILENCE))?;
    let mut reader = BufReader::new(stream);
    let mut first = String::new();
    reader.read_line(&mut first)?;
    let mut length = 0;
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line)? <= 2 {
            break;
        }
        if let Some(value) = line.to_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse()?;
        }
    }
    let mut words = first.split_whitespace();
    let (method, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let name = path.split('?').next().unwrap_or_default().trim_start_matches('/');
    if (method, name) == ("POST", REPORT) {
        let mut body = vec![0; length];
        reader.read_exact(&mut body)?;
        reply(reader.into_inner(), "204 No Content", "text/plain", &[])?;
        return Ok(Some(String::from_utf8(body)?));
    }
    let name = if name.is_empty() { "index.html" } else { name };
    let kind = KINDS.iter().find(|(extension, _)| name.ends_with(&format!(".{extension}")));
    // Names of plain files only: nothing outside of the folder.
    let file =
        kind.filter(|_| method == "GET" && !name.contains(['/', '\\'])).map(|(_, kind)| (kind, folder.join(name)));
    match file.and_then(|(kind, path)| Some((kind, fs::read(path).ok()?))) {
        Some((kind, content)) => reply(reader.into_inner(), "200 OK", kind, &content)?,
        None => reply(reader.into_inner(), "404 Not Found", "text/plain", b"not found")?,
    }
    Ok(None)
}

fn reply(mut stream: TcpStream, status: &str, kind: &str, content: &[u8]) -> Result<()> {
    let length = content.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    stream.write_all(head.as_bytes())?;
    stream.write_all(content)?;
    Ok(stream.flush()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(address: std::net::SocketAddr, request: &str) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn files_are_served_until_a_report_arrives() {
        let folder = crate::workspace::root().join("target/xtask-serve-test");
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("index.html"), "page").unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let browser = thread::spawn(move || {
            assert!(asked(address, "GET /?report HTTP/1.1\r\nHost: x\r\n\r\n").ends_with("\r\n\r\npage"));
            assert!(asked(address, "GET /../Cargo.toml HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404"));
            asked(address, "POST /report HTTP/1.1\r\nContent-Length: 4\r\n\r\n{\"a\"")
        });
        let report = until_reported(&listener, &folder, Duration::from_secs(20), || Ok(())).unwrap();
        assert_eq!(report, "{\"a\"");
        assert!(browser.join().unwrap().starts_with("HTTP/1.1 204"));
        assert!(until_reported(&listener, &folder, Duration::from_millis(50), || Ok(())).is_err());
        let ended = until_reported(&listener, &folder, Duration::from_secs(20), || bail!("ended")).unwrap_err();
        assert_eq!(ended.to_string(), "ended");
        fs::remove_dir_all(&folder).unwrap();
    }
}
