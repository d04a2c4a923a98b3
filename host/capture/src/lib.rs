//! The serial client, cameras and capture workflows.
