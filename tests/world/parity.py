"""One check for every law: floats, arrays and casadi symbols give the same numbers.

What is not known stays not known: an argument that is NaN makes NaN of each output that it is in.
"""

import inspect
import warnings
from collections.abc import Callable

import casadi
import numpy as np
from numpy.typing import NDArray

COUNT = 12


def check_parity(law: Callable, **ranges: tuple[float, float]) -> None:
    """Compare a law in its four forms on random arguments within ranges.

    The ranges have to name every argument of the law. Scalars through plain Python are the
    reference; an array of shape (N, M) must give them entry by entry.
    """
    names = list(inspect.signature(law).parameters)
    assert set(ranges) == set(names), f"ranges must name {names}"
    random = np.random.default_rng(20240611)
    columns = [random.uniform(*ranges[name], COUNT) for name in names]
    reference = np.array([_flat(law(*map(float, row))) for row in zip(*columns, strict=True)])
    assert np.all(np.isfinite(reference))
    assert np.all(np.ptp(reference, axis=0) > 0.0), "a constant law would hide a lost argument"

    grid = [column.reshape(3, COUNT // 3) for column in columns]
    arrays = _outputs(law(*grid))
    assert all(array.shape == grid[0].shape for array in arrays)
    _assert_same(np.stack([array.ravel() for array in arrays], axis=-1), reference)
    by_keyword = _outputs(law(**dict(zip(names, columns, strict=True))))
    _assert_same(np.stack(by_keyword, axis=-1), reference)

    symbols = [casadi.SX.sym(name) for name in names]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # casadi announces another numpy mode
        outputs = list(_outputs(law(*symbols)))
    assert all(isinstance(output, casadi.SX) and output.is_scalar() for output in outputs)
    function = casadi.Function("law", symbols, outputs).map(COUNT)
    values = _outputs(function(*[column.reshape(1, -1) for column in columns]))
    _assert_same(np.stack([np.array(value).ravel() for value in values], axis=-1), reference)
    gradient = casadi.jacobian(casadi.vertcat(*outputs), casadi.vertcat(*symbols))
    slopes = casadi.Function("slopes", symbols, [gradient]).map(COUNT)
    assert np.all(np.isfinite(np.array(slopes(*[column.reshape(1, -1) for column in columns]))))

    _assert_nan_is_preserved(law, columns, symbols, outputs)


def check_outside(law: Callable, arguments: dict[str, float], expected: float = np.nan) -> None:
    """A law gives NaN, or a limit, outside its domain, in all three forms; all outputs alike."""
    names = list(inspect.signature(law).parameters)
    row = [float(arguments[name]) for name in names]
    with np.errstate(all="ignore"):
        values = [
            _flat(law(*row)),
            [float(o[1]) for o in _outputs(law(*(np.full(2, x) for x in row)))],
        ]
    symbols = [casadi.SX.sym(name) for name in names]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        outputs = list(_outputs(law(*symbols)))
    values.append([float(o) for o in casadi.Function("law", symbols, outputs).call(row)])
    np.testing.assert_array_equal(np.array(values), expected)


def _assert_nan_is_preserved(
    law: Callable, columns: list[NDArray], symbols: list, outputs: list
) -> None:
    """One argument after the other is NaN, in all three forms."""
    function = casadi.Function("law", symbols, outputs)
    for i, symbol in enumerate(symbols):
        within = [casadi.jacobian(output, symbol).nnz() > 0 for output in outputs]
        row = [float(column[0]) for column in columns]
        row[i] = np.nan
        arrays = [np.full(2, value) for value in row]
        for values in (
            _flat(law(*row)),
            [float(o) for o in function.call(row)],
            [float(output[1]) for output in _outputs(law(*arrays))],
        ):
            is_nan = [bool(np.isnan(value)) for value in values]
            assert is_nan == within, f"{law.__name__}: {symbol} is NaN, the outputs are {values}"


def _outputs(value: object) -> tuple:
    return value if isinstance(value, tuple) else (value,)


def _flat(value: object) -> list[float]:
    return [float(entry) for entry in _outputs(value)]


def _assert_same(actual: NDArray, expected: NDArray) -> None:
    np.testing.assert_allclose(actual, expected, rtol=1e-11, atol=1e-12)
