//! Drawn worlds: rooms with people in them, seen by the sensors of a robot, and
//! the truth about all of it.

mod body;
mod gait;
mod material;
mod random;
mod shape;
