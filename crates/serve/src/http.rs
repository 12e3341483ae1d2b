//! The subset of HTTP/1.1 that a page on this computer needs: requests with limits on everything,
//! and one answer per connection.

use serde::Serialize;

/// Longest request line with all headers, bytes.
const HEAD_BYTES: usize = 16 << 10;

/// End of the headers.
const HEAD_END: &[u8] = b"\r\n\r\n";

/// Largest number of header lines.
const HEADERS: usize = 100;

/// Request of a browser or a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// `GET` or `POST`, or another method.
    pub method: String,
    /// Path with the query, as it was sent.
    pub path: String,
    headers: Vec<(String, String)>,
    /// The body.
    pub body: Vec<u8>,
}

impl Request {
    /// Returns true for `GET` and `HEAD`, which change nothing.
    pub fn is_read(&self) -> bool {
        matches!(self.method.as_str(), "GET" | "HEAD")
    }

    /// Returns a header by its name in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

/// Answer to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Response {
    /// Status code.
    pub status: u16,
    /// Type of the body.
    pub kind: &'static str,
    /// The body.
    pub body: Vec<u8>,
}

impl Response {
    /// Returns a body with status 200.
    pub fn ok(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, kind, body: body.into() }
    }

    /// Returns data as JSON with status 200.
    pub fn json(data: &impl Serialize) -> Self {
        match serde_json::to_vec(data) {
            Ok(bytes) => Self::ok("application/json", bytes),
            Err(error) => Self::refusal(500, error.to_string()),
        }
    }

    /// Returns the answer for a path that the site does not have.
    pub fn not_found() -> Self {
        Self::refusal(404, "there is no such page")
    }

    /// Returns a refusal with its reason.
    pub fn refusal(status: u16, why: impl Into<String>) -> Self {
        Self { status, kind: "text/plain; charset=utf-8", body: why.into().into_bytes() }
    }

    /// Returns the bytes of the answer, whose headers say that the connection is closed.
    pub(crate) fn into_bytes(self, head_only: bool) -> Vec<u8> {
        let Self { status, kind, body } = self;
        let reason = match status {
            200 => "OK",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            408 => "Request Timeout",
            409 => "Conflict",
            411 => "Length Required",
            413 => "Content Too Large",
            415 => "Unsupported Media Type",
            431 => "Request Header Fields Too Large",
            503 => "Service Unavailable",
            _ => "Internal Server Error",
        };
        let length = body.len();
        // Nothing but the files of this server runs in the page, and no other page may frame it.
        let head = format!(
            "HTTP/1.1 {status} {reason}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\
             Connection: close\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n\
             Referrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n\
             Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; \
             img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
             frame-ancestors 'none'\r\n\r\n"
        );
        let mut bytes = head.into_bytes();
        if !head_only {
            bytes.extend(body);
        }
        bytes
    }
}

/// Request that arrives in parts.
#[derive(Debug, Default)]
pub struct Incoming {
    /// Bytes that are not parsed yet.
    bytes: Vec<u8>,
    /// Request without its body, and the length of that.
    head: Option<(Request, usize)>,
}

impl Incoming {
    /// Adds the next bytes, and returns the request once it is complete. Its body has at most
    /// `body_bytes`.
    ///
    /// # Errors
    /// The answer that refuses the request.
    pub fn take(&mut self, part: &[u8], body_bytes: usize) -> Result<Option<Request>, Response> {
        // The end of the head may be split over two parts.
        let searched = self.bytes.len().saturating_sub(HEAD_END.len() - 1);
        self.bytes.extend_from_slice(part);
        if self.head.is_none() {
            let end = find(&self.bytes[searched..], HEAD_END).map(|at| searched + at);
            if end.unwrap_or(self.bytes.len()) > HEAD_BYTES {
                return Err(Response::refusal(431, "the headers are too long"));
            }
            let Some(end) = end else { return Ok(None) };
            let request = parse_head(&self.bytes[..end])?;
            let length = body_length(&request, body_bytes)?;
            self.bytes.drain(..end + HEAD_END.len());
            self.head = Some((request, length));
        }
        let is_whole = self.head.as_ref().is_some_and(|(_, length)| self.bytes.len() >= *length);
        let Some((mut request, length)) = self.head.take_if(|_| is_whole) else { return Ok(None) };
        self.bytes.truncate(length);
        request.body = std::mem::take(&mut self.bytes);
        Ok(Some(request))
    }
}

fn find(bytes: &[u8], part: &[u8]) -> Option<usize> {
    bytes.windows(part.len()).position(|window| window == part)
}

fn parse_head(bytes: &[u8]) -> Result<Request, Response> {
    fn wrong(why: &str) -> Response {
        Response::refusal(400, why)
    }

    fn is_name(b: u8) -> bool {
        b.is_ascii_alphanumeric() || b"-_".contains(&b)
    }

    let text = std::str::from_utf8(bytes).map_err(|_| wrong("the headers are no text"))?;
    if text.chars().any(|c| c.is_control() && c != '\r' && c != '\n' && c != '\t') {
        return Err(wrong("the headers have control characters"));
    }
    let mut lines = text.split("\r\n");
    let first: Vec<&str> = lines.next().unwrap_or_default().split(' ').collect();
    let [method, path, version] = first[..] else {
        return Err(wrong("the first line is not `METHOD PATH VERSION`"));
    };
    if !matches!(version, "HTTP/1.1" | "HTTP/1.0") {
        return Err(wrong("the version is neither HTTP/1.1 nor HTTP/1.0"));
    }
    if !path.starts_with('/') {
        return Err(wrong("the path does not begin with a slash"));
    }
    let mut headers: Vec<(String, String)> = Vec::new();
    for line in lines {
        let (name, value) = line.split_once(':').ok_or_else(|| wrong("a header has no colon"))?;
        if name.is_empty() || !name.bytes().all(is_name) || value.contains(['\r', '\n']) {
            return Err(wrong("a header has an invalid name or value"));
        }
        let name = name.to_ascii_lowercase();
        // Two such headers would be ambiguous.
        let is_single = matches!(name.as_str(), "host" | "content-length" | "origin");
        if is_single && headers.iter().any(|(other, _)| *other == name) {
            return Err(wrong("a header occurs twice"));
        }
        headers.push((name, value.trim().to_owned()));
        if headers.len() > HEADERS {
            return Err(Response::refusal(431, "there are too many headers"));
        }
    }
    let method = method.to_owned();
    let path = path.to_owned();
    Ok(Request { method, path, headers, body: Vec::new() })
}

fn body_length(request: &Request, most: usize) -> Result<usize, Response> {
    if request.header("transfer-encoding").is_some() {
        return Err(Response::refusal(411, "the length of the body is missing"));
    }
    let Some(text) = request.header("content-length") else { return Ok(0) };
    // `parse` alone would accept a plus sign.
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !is_number {
        return Err(Response::refusal(400, "the length of the body is not a number"));
    }
    match text.parse::<usize>() {
        Ok(length) if length <= most => Ok(length),
        _ => Err(Response::refusal(413, "the body is too long")),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Longest body in these tests, bytes.
    const BODY_BYTES: usize = 16 << 10;

    /// Returns the status of a refusal, and 0 for a request that is cut off.
    fn status(bytes: &[u8]) -> Option<u16> {
        match Incoming::default().take(bytes, BODY_BYTES) {
            Ok(Some(_)) => None,
            Ok(None) => Some(0),
            Err(refusal) => Some(refusal.status),
        }
    }

    /// Returns the result of a request that arrives in parts of these lengths, and then the rest.
    fn taken_in_parts(bytes: &[u8], lengths: &[usize]) -> Result<Option<Request>, Response> {
        let mut incoming = Incoming::default();
        let mut rest = bytes;
        for length in lengths {
            let (part, behind) = rest.split_at((*length).min(rest.len()));
            if let Some(request) = incoming.take(part, BODY_BYTES)? {
                return Ok(Some(request));
            }
            rest = behind;
        }
        incoming.take(rest, BODY_BYTES)
    }

    proptest! {
        #[test]
        fn a_request_is_the_same_however_it_is_cut(
            head in "(GET|POST) /[a-z]{0,9} HTTP/1.1\r\n(A: [a-z\r\n]{0,9}\r\n){0,3}",
            length in 0..40_usize,
            body in prop::collection::vec(any::<u8>(), 0..50),
            cuts in prop::collection::vec(0..30_usize, 0..12),
        ) {
            let mut bytes = format!("{head}Content-Length: {length}\r\n\r\n").into_bytes();
            bytes.extend(body);
            prop_assert_eq!(taken_in_parts(&bytes, &cuts), taken_in_parts(&bytes, &[]));
        }

        #[test]
        fn no_bytes_make_the_parser_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            cuts in prop::collection::vec(0..30_usize, 0..12),
        ) {
            let _ = taken_in_parts(&bytes, &cuts);
        }
    }

    #[test]
    fn a_request_is_read_with_its_headers_and_its_body() {
        let text = b"POST /a?b HTTP/1.1\r\nHost: x:1\r\nCONTENT-length: 3\r\n\r\nabcdef";
        let request = Incoming::default().take(text, BODY_BYTES).unwrap().unwrap();
        assert_eq!((request.method.as_str(), request.path.as_str()), ("POST", "/a?b"));
        assert_eq!(request.header("host"), Some("x:1"));
        assert_eq!(request.body, b"abc");
    }

    #[test]
    fn hostile_requests_are_refused() {
        for (bytes, wanted) in [
            (&b""[..], 0),
            (b"GET /", 0),
            (b"GET  / HTTP/1.1\r\n\r\n", 400),
            (b"GET / HTTP/2.0\r\n\r\n", 400),
            (b"GET http://x/ HTTP/1.1\r\n\r\n", 400),
            (b"\x16\x03\x01\x02\x00\r\n\r\n", 400),
            (b"GET / HTTP/1.1\r\nno colon\r\n\r\n", 400),
            (b"GET / HTTP/1.1\r\nHost: a\r\n b: c\r\n\r\n", 400),
            (b"GET / HTTP/1.1\r\nHost: a\nX: b\r\n\r\n", 400),
            (b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400),
            (b"GET /\0 HTTP/1.1\r\n\r\n", 400),
            (b"GET /\xff HTTP/1.1\r\n\r\n", 400),
            (b"POST / HTTP/1.1\r\nContent-Length: +3\r\n\r\nabc", 400),
            (b"POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n", 400),
            (b"POST / HTTP/1.1\r\nContent-Length: 3\r\nContent-Length: 4\r\n\r\nabc", 400),
            (b"POST / HTTP/1.1\r\nContent-Length: 99999999999999999999\r\n\r\n", 413),
            (b"POST / HTTP/1.1\r\nContent-Length: 16385\r\n\r\n", 413),
            (b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 411),
            (b"POST / HTTP/1.1\r\nContent-Length: 9\r\n\r\nabc", 0),
        ] {
            let shown = String::from_utf8_lossy(bytes);
            assert_eq!(status(bytes), Some(wanted), "{shown:?}");
        }
        let long = format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(HEAD_BYTES));
        assert_eq!(status(long.as_bytes()), Some(431));
        let endless = "a".repeat(4 * HEAD_BYTES);
        assert_eq!(status(endless.as_bytes()), Some(431));
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(HEADERS + 1));
        assert_eq!(status(many.as_bytes()), Some(431));
    }
}
