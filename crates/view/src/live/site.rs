//! Pages and answers of the server, all of which are read-only.

use std::sync::Arc;

use crate::page::data::{PageData, RunData};
use crate::page::html::{Heading, live_html, scripts, style};
use crate::page::robot::robot_data;
use tagalong_serve::{Request, Response, Site};
use toml::Table;

use crate::live::newest::Newest;

/// The page, and the answers to its requests.
pub struct Page {
    html: String,
    style: String,
    newest: Arc<Newest>,
}

impl Page {
    /// Creates the page.
    ///
    /// # Errors
    /// Names that JSON cannot express.
    pub fn new(
        heading: &Heading,
        name: &str,
        config: &Table,
        newest: Arc<Newest>,
    ) -> Result<Self, String> {
        let robot = robot_data(config);
        let runs = vec![RunData { name: name.to_owned(), robot, ..RunData::default() }];
        let data = PageData { runs, live: true, ..PageData::default() };
        let html = live_html(heading, &data).map_err(|error| error.to_string())?;
        Ok(Self { html, style: style(), newest })
    }
}

impl Site for Page {
    fn answer(&self, _request: &Request, path: &str) -> Response {
        if let Some(after) = path.strip_prefix("now?after=") {
            return match after.parse() {
                Ok(after) => self.newest.answer(after, |now| Response::json(now)),
                Err(_) => Response::refusal(400, "`after` is the number of a frame"),
            };
        }
        if let Some((_, text)) = scripts().into_iter().find(|(name, _)| *name == path) {
            return Response::ok("text/javascript; charset=utf-8", text);
        }
        match path {
            "" => Response::ok("text/html; charset=utf-8", self.html.as_bytes()),
            "page.css" => Response::ok("text/css; charset=utf-8", self.style.as_bytes()),
            _ => Response::not_found(),
        }
    }
}
