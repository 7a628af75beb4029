"""Products of a small matrix with many columns, several columns at a time in the processor's vectors.

The compiler vectorises loops, not matrices this small: a loop over 17 columns costs more to enter than to run. Written
as vectors of eight or four numbers the sums of several rows stay in registers, and a cell's equations take a fourth of
the time at 16 columns. LLVM turns these vectors into what the processor has.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from model.compiled import allocates_nothing

Floats = NDArray[np.float64]

#: Columns come in multiples of this.
WIDTH = 4


def _kernel(rows: int, wide: int) -> Callable[..., Any]:
    """out[row : row + rows, column : column + wide] = matrix[row : row + rows] @ block[:, column : column + wide].

    All (.., ..) float64, rows contiguous; nothing is checked.
    """

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = ir.DoubleType()
        vector = ir.VectorType(number, wide)

        def view(at: int) -> tuple[Any, Any, Any]:
            array = context.make_array(signature.args[at])(context, builder, arguments[at])
            many = cgutils.unpack_tuple(builder, array.shape, 2)[1]
            return builder.bitcast(array.data, ir.IntType(8).as_pointer()), array.strides, many

        def place(base: Any, strides: Any, row: Any, column: Any, kind: Any) -> Any:
            pitch = cgutils.unpack_tuple(builder, strides, 2)[0]
            offset = builder.add(builder.mul(row, pitch), builder.mul(column, column.type(8)))
            return builder.bitcast(builder.gep(base, [offset]), kind.as_pointer())

        (matrix, by, many), (block, across, _), (out, down, _) = view(0), view(1), view(2)
        row, column = arguments[3], arguments[4]
        sums = [cgutils.alloca_once(builder, vector) for _ in range(rows)]
        for total in sums:
            builder.store(ir.Constant(vector, [0.0] * wide), total)
        with cgutils.for_range(builder, many) as loop:
            these = builder.load(place(block, across, loop.index, column, vector), align=8)
            for step, total in enumerate(sums):
                share = builder.load(place(matrix, by, builder.add(row, row.type(step)), loop.index, number))
                first = builder.insert_element(ir.Constant(vector, ir.Undefined), share, ir.Constant(ir.IntType(32), 0))
                same = builder.shuffle_vector(
                    first, ir.Constant(vector, ir.Undefined), ir.Constant(ir.VectorType(ir.IntType(32), wide), [0] * wide)
                )
                more = builder.fmul(same, these, flags=("contract",))
                builder.store(builder.fadd(builder.load(total), more, flags=("contract",)), total)
        for step, total in enumerate(sums):
            to = place(out, down, builder.add(row, row.type(step)), column, vector)
            builder.store(builder.load(total), to, align=8)
        return context.get_dummy_value()

    def kernel(typing: Any, matrix: Any, block: Any, out: Any, row: Any, column: Any) -> Any:
        return types.none(matrix, block, out, types.intp, types.intp), emit

    return intrinsic(kernel)  # type: ignore[no-any-return]


_three8, _two8, _one8 = _kernel(3, 8), _kernel(2, 8), _kernel(1, 8)
_three4, _two4, _one4 = _kernel(3, 4), _kernel(2, 4), _kernel(1, 4)


@allocates_nothing
def product8(matrix: Floats, block: Floats, out: Floats, column: int) -> None:
    """Eight columns of out = matrix @ block, from ``column`` on."""
    row, rows = 0, matrix.shape[0]
    while row + 3 <= rows:
        _three8(matrix, block, out, row, column)
        row += 3
    if row + 2 == rows:
        _two8(matrix, block, out, row, column)
    elif row < rows:
        _one8(matrix, block, out, row, column)


@allocates_nothing
def product4(matrix: Floats, block: Floats, out: Floats, column: int) -> None:
    """Four columns of out = matrix @ block, from ``column`` on."""
    row, rows = 0, matrix.shape[0]
    while row + 3 <= rows:
        _three4(matrix, block, out, row, column)
        row += 3
    if row + 2 == rows:
        _two4(matrix, block, out, row, column)
    elif row < rows:
        _one4(matrix, block, out, row, column)
