mod depth;
mod kernels;
mod reference;
