"""Records of ground motions in the package, and those of FEMA P695.

`tpd.Record.read` and `tpd.Record.read_all` read files of your own.
"""

from tpd.records.sets import el_centro as el_centro
from tpd.records.sets import fema_p695 as fema_p695
from tpd.records.sets import loma_prieta as loma_prieta
