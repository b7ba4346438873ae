"""64-bit floats, no silent rank promotion, and jaxtyping shapes checked by beartype."""

import jax
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")

install_import_hook("tpd", "beartype.beartype")
