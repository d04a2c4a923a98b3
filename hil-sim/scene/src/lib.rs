//! What a camera would see: scenes, textures, lens, point spread functions, exposure and noise.
