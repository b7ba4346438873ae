"""64-bit floats, no silent rank promotion, and jaxtyping shapes checked by beartype."""

from pathlib import Path

import jax
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
# What one worker has compiled, the other need not, nor a later run.
jax.config.update("jax_compilation_cache_dir", str(Path(__file__).parents[1] / ".pytest_cache" / "compiled"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 1.0)

install_import_hook("tpd", "beartype.beartype")
