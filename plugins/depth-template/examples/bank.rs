//! Draws the templates of `depth-template` as text: one block for each body
//! direction, seen level and from 30 degrees above.

use std::io::{self, Write};

use tagalong_depth_template::{Bank, Direction, Pose};

fn main() -> io::Result<()> {
    let mut out = io::stdout().lock();
    let mut bank = Bank::new(1000);
    for pitch_deg in [0.0_f64, 30.0] {
        for direction in Direction::ALL {
            let pose = Pose::nearest(direction, pitch_deg.to_radians(), 0.0, 60.0);
            let template = bank.template(pose);
            writeln!(out, "\n{direction:?}, seen from {pitch_deg} degrees above")?;
            for row in &template.rows {
                let line: String = (-template.half_width..=template.half_width)
                    .map(|x| if row.from <= x && x < row.to { "##" } else { ". " })
                    .collect();
                writeln!(out, "{line}  {:+.2} m", row.relief_m)?;
            }
        }
    }
    Ok(())
}
