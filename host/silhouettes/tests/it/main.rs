mod background;
mod bvh;
mod damaged;
mod long_c3d;
mod readers;
mod standing;
