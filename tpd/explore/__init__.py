"""An interactive page of a design: sliders, the response that follows them, and a block that rocks."""
