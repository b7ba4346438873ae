"""Limits and objectives of a design, for users of the package; `tpd.design.criteria` defines them."""

from tpd.design.criteria import *  # noqa: F403
