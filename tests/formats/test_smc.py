"""Files of SMC of the USGS."""

from tests.formats.reader import check


def test_what_is_written_is_read_and_a_damaged_file_is_never_half_read(tmp_path):
    check(tmp_path, "smc", "loma_prieta_1989_0111a.smc.gz")
