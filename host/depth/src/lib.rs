//! Depth from defocus: optics, operators, run time, metrics; pure, no input or output.
