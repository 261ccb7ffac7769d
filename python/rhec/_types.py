"""Names for what the package is given."""
from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike
# A YAML file, or the same as a dict.
Configuration = Union[str, "os.PathLike[str]", dict[str, Any]]
# Dotted keys and their values.
Changes = Union[Mapping[str, Any], None]
# One directory, or several.
PluginPath = Union[str, "os.PathLike[str]", Sequence[Union[str, "os.PathLike[str]"]]]
# A file, or an array (n, 3).
LogPart = Union[str, "os.PathLike[str]", ArrayLike]
# A file or a Log; a table by columns, several of them; or, beside fixes, an array (n, 3).
DriveLog = Any
# By names or symbols a dict, a list, a matrix, or a vector of symbols.
Terms = Any
# None for a bar where one can be seen, True, False, or a function of (share, text).
Progress = Union[bool, Callable[[float, str], object], None]
File = Union[str, "os.PathLike[str]"]
