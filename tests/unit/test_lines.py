"""Lines in spectra."""

import numpy as np

from hil.identification.grey_box.lines import prominence


def test_a_falling_spectrum_has_no_line_but_the_one_put_there():
    frequency = np.arange(1.0, 2000.0)
    power = frequency**-4.0
    assert prominence(power).max() < 1.1
    power[200] *= 10.0
    assert np.argmax(prominence(power)) == 200
    assert prominence(power)[200] > 8.0
