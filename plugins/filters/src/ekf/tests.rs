mod model;
mod standing;
mod world;
