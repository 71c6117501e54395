"""Files of arrays with names: written whole, or refused with the reason."""

import numpy as np
import pytest
import scipy.io

from identification.words import InputError
from mbw.files import write_named_arrays


@pytest.mark.parametrize("suffix", ["mat", "npz"])
def test_a_file_that_cannot_be_written_is_refused_with_the_reason(tmp_path, suffix):
    target = tmp_path / "missing" / f"plant.{suffix}"
    with pytest.raises(InputError, match=r"cannot be written \(No such file or directory\)"):
        write_named_arrays(target, {"A": np.eye(2)}, {"names": ["a", "b"]})


def test_names_become_cells_in_matlab(tmp_path):
    write_named_arrays(tmp_path / "plant.mat", {"A": np.eye(2)}, {"names": ["a", "bc"]})
    content = scipy.io.loadmat(tmp_path / "plant.mat", simplify_cells=True)
    assert content["names"].tolist() == ["a", "bc"]
    np.testing.assert_array_equal(content["A"], np.eye(2))
