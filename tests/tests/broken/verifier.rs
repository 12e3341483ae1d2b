use tagalong_config::Registry;
use tagalong_core::{Detection, Error, Frame, Input, Inputs, Result, Verifier};

use super::{mood, register_with_fault};

pub fn register(registry: &mut Registry, name: &'static str) {
    let plugin = move || Brightness { fault: name, mood: mood(), asked: 0.0 };
    register_with_fault!(registry, verifier, name, plugin);
}

/// Verifier with higher log-odds for darker regions.
struct Brightness {
    fault: &'static str,
    mood: f64,
    asked: f64,
}

impl Verifier for Brightness {
    fn inputs(&self) -> Inputs {
        match self.fault {
            "secretive" => Inputs::NONE,
            "easy-going" => Inputs::NONE.accept(Input::Colour),
            _ => Inputs::NONE.require(Input::Colour),
        }
    }

    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        assert!(self.fault != "panics" || frame.camera.width > 1, "cannot see");
        if self.fault == "vague" && frame.colour().is_err() {
            return Err(Error::Other("something is missing".into()));
        }
        let grey = frame.grey()?;
        let inside = candidate.rect_in(&frame.camera).clipped(grey.width(), grey.height());
        if inside.area() <= 0.0 {
            return Ok(-1.0);
        }
        let x0 = inside.x as usize;
        let y0 = inside.y as usize;
        let x1 = inside.right() as usize;
        let y1 = inside.bottom() as usize;
        let pixels = (y0..y1).flat_map(|y| &grey.row(y)[x0..x1]);
        let (sum, count) =
            pixels.fold((0.0, 0.0), |(sum, count), p| (sum + f64::from(*p), count + 1.0));
        self.asked += 1.0;
        let fault = match self.fault {
            "moody" => self.mood,
            "changes-its-mind" => self.asked,
            _ => 0.0,
        };
        Ok(if count > 0.0 { 1.0 - sum / count / 128.0 } else { -1.0 } + fault)
    }
}
