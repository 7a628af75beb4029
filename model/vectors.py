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
from numba.core import cgutils as untyped
from numba.extending import intrinsic
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing

Floats = NDArray[np.float64]

cgutils: Any = untyped

#: Columns come in multiples of this.
WIDTH = 4


def _kernel(rows: int, wide: int, split: int) -> Callable[..., Any]:
    """Some columns of some rows of a product, matrix[row : row + rows] @ block[:, column : column + wide]: the first
    ``split`` rows into out[row :], the others into other[:].

    All (.., ..) float64, rows contiguous; nothing is checked.
    """
    vector, number, index = ir.VectorType(ir.DoubleType(), wide), ir.DoubleType(), ir.IntType(32)
    nothing, zeros = ir.Constant(vector, ir.Undefined), ir.Constant(ir.VectorType(index, wide), [0] * wide)

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix, block, out, other = (
            context.make_array(signature.args[at])(context, builder, arguments[at]) for at in range(4)
        )
        row, column = arguments[4], arguments[5]

        def place(array: Any, row: Any, column: Any, kind: Any) -> Any:
            pitch = cgutils.unpack_tuple(builder, array.strides, 2)[0]
            offset = builder.add(builder.mul(row, pitch), builder.mul(column, column.type(8)))
            start = builder.bitcast(array.data, ir.IntType(8).as_pointer())
            return builder.bitcast(builder.gep(start, [offset]), kind.as_pointer())

        sums = [cgutils.alloca_once(builder, vector) for _ in range(rows)]
        for total in sums:
            builder.store(ir.Constant(vector, [0.0] * wide), total)
        with cgutils.for_range(builder, cgutils.unpack_tuple(builder, matrix.shape, 2)[1]) as loop:
            these = builder.load(place(block, loop.index, column, vector), align=8)
            for step, total in enumerate(sums):
                share = builder.load(place(matrix, builder.add(row, row.type(step)), loop.index, number))
                single = builder.insert_element(nothing, share, index(0))
                more = builder.fmul(builder.shuffle_vector(single, nothing, zeros), these, flags=("contract",))
                builder.store(builder.fadd(builder.load(total), more, flags=("contract",)), total)
        for step, total in enumerate(sums):
            at = builder.add(row, row.type(step)) if step < split else row.type(step - split)
            builder.store(builder.load(total), place(out if step < split else other, at, column, vector), align=8)
        return context.get_dummy_value()

    def kernel(typing: Any, matrix: Any, block: Any, out: Any, other: Any, row: Any, column: Any) -> Any:
        return types.none(matrix, block, out, other, types.intp, types.intp), emit

    return intrinsic(kernel)


def _plus(typing: Any, one: Any, share: Any, other: Any, out: Any) -> Any:
    """out = one + share * other, all (n,) float64 without gaps, n a multiple of `WIDTH`; nothing is checked."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = ir.VectorType(ir.DoubleType(), WIDTH)
        arrays = [context.make_array(signature.args[at])(context, builder, arguments[at]) for at in (0, 2, 3)]
        many = cgutils.unpack_tuple(builder, arrays[2].shape, 1)[0]
        first, second, to = (builder.bitcast(array.data, vector.as_pointer()) for array in arrays)
        single = builder.insert_element(ir.Constant(vector, ir.Undefined), arguments[1], ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
        same = builder.shuffle_vector(single, ir.Constant(vector, ir.Undefined), zeros)
        with cgutils.for_range(builder, builder.udiv(many, many.type(WIDTH))) as loop:
            more = builder.load(builder.gep(second, [loop.index]), align=8)
            total = builder.load(builder.gep(first, [loop.index]), align=8)
            total = builder.fadd(total, builder.fmul(same, more, flags=("contract",)), flags=("contract",))
            builder.store(total, builder.gep(to, [loop.index]), align=8)
        return context.get_dummy_value()

    return types.none(one, types.float64, other, out), emit


#: out = one + share * other: plus(one, share, other, out), see `_plus`.
plus: Callable[..., Any] = intrinsic(_plus)

_three8, _two8, _one8 = _kernel(3, 8, 3), _kernel(2, 8, 2), _kernel(1, 8, 1)
_three4, _two4, _one4 = _kernel(3, 4, 3), _kernel(2, 4, 2), _kernel(1, 4, 1)
#: What moves in a cell of a straw with rigid odd frusta, and a wrench or what a joint does.
_back8, _back4, _ahead8, _ahead4 = _kernel(5, 8, 2), _kernel(5, 4, 2), _kernel(8, 8, 2), _kernel(8, 4, 2)


@allocates_nothing
def _rows8(matrix: Floats, block: Floats, out: Floats, column: int) -> None:
    row, rows = 0, matrix.shape[0]
    while row + 3 <= rows:
        _three8(matrix, block, out, out, row, column)
        row += 3
    if row + 2 == rows:
        _two8(matrix, block, out, out, row, column)
    elif row < rows:
        _one8(matrix, block, out, out, row, column)


@allocates_nothing
def _rows4(matrix: Floats, block: Floats, out: Floats, column: int) -> None:
    row, rows = 0, matrix.shape[0]
    while row + 3 <= rows:
        _three4(matrix, block, out, out, row, column)
        row += 3
    if row + 2 == rows:
        _two4(matrix, block, out, out, row, column)
    elif row < rows:
        _one4(matrix, block, out, out, row, column)


@allocates_nothing
def product8(matrix: Floats, block: Floats, out: Floats, other: Floats, split: int, column: int) -> None:
    """Eight columns of matrix @ block, from ``column`` on: the first ``split`` rows into out, others into other."""
    rows = matrix.shape[0]
    if split == 2 and rows == 5:
        _back8(matrix, block, out, other, 0, column)
    elif split == 2 and rows == 8:
        _ahead8(matrix, block, out, other, 0, column)
    else:
        _rows8(matrix[:split], block, out, column)
        _rows8(matrix[split:], block, other, column)


@allocates_nothing
def product4(matrix: Floats, block: Floats, out: Floats, other: Floats, split: int, column: int) -> None:
    """Four columns, otherwise as `product8`."""
    rows = matrix.shape[0]
    if split == 2 and rows == 5:
        _back4(matrix, block, out, other, 0, column)
    elif split == 2 and rows == 8:
        _ahead4(matrix, block, out, other, 0, column)
    else:
        _rows4(matrix[:split], block, out, column)
        _rows4(matrix[split:], block, other, column)
