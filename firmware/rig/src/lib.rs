//! What the board does: axes, piezo, homing, exposure program; no hardware access, time as an argument.
#![no_std]
