//! Fixed-point mathematics with the same bits on the board and on the host.
#![no_std]
