"""Points in the order of space-filling curves, as Generative Densification groups them, and the neighbours of its
submanifold convolutions."""
import torch

ORDERS = ("z", "z-trans", "hilbert", "hilbert-trans")


def grid_cells(xyz, cell):
    """(P,3) -> integer cells, from the smallest coordinate of each axis."""
    return torch.trunc((xyz - xyz.min(0)[0]) / cell).long()


def curve_depth(cells):
    """Bits per axis. (With every point in one cell the published code gives up; here that is depth 1.)"""
    return max(1, int(cells.max()).bit_length())


def _interleave(x, y, z, depth):
    key = torch.zeros_like(x)
    for i in range(depth):
        key = key | ((x >> i & 1) << 3 * i + 2) | ((y >> i & 1) << 3 * i + 1) | ((z >> i & 1) << 3 * i)
    return key


def z_code(cells, depth):
    """Morton code, x in the highest bit of each triple."""
    return _interleave(*cells.unbind(1), depth)


def hilbert_code(cells, depth):
    """Skilling's Hilbert curve: from the top bit down, axis by axis, a set bit inverts the lower bits of the first axis,
    a clear one swaps them with that axis's; then the interleaved bits are read as a Gray code."""
    a = list(cells.unbind(1))
    for q in range(depth - 1, -1, -1):
        low = (1 << q) - 1
        for d in range(3):
            on = (a[d] >> q & 1).bool()
            swap = torch.where(on, torch.zeros_like(a[0]), (a[0] ^ a[d]) & low)
            a[0] = torch.where(on, a[0] ^ low, a[0] ^ swap)
            if d:
                a[d] = a[d] ^ swap
    code = _interleave(*a, depth)
    for shift in (1, 2, 4, 8, 16, 32):                          # Gray to binary: the XOR of all higher bits
        code = code ^ (code >> shift)
    return code


def serial_codes(cells, names):
    """(P,3) -> (orders,P) int64. "-trans": x and y change places."""
    depth, flipped = curve_depth(cells), cells[:, [1, 0, 2]]
    return torch.stack([(z_code if n.startswith("z") else hilbert_code)(flipped if n.endswith("trans") else cells, depth) for n in names])


def serial_orders(codes, perm):
    """-> (orders,P): the points in ascending order of each code, ties by index, the orders themselves permuted."""
    return torch.argsort(codes, dim=1, stable=True)[list(perm)]


def random_perms(seed, levels=2, count=4):
    """The permutations that the published code draws when torch.manual_seed(seed) comes right before its forward pass."""
    gen = torch.Generator().manual_seed(seed)
    return [torch.randperm(count, generator=gen).tolist() for _ in range(levels)]


def patch_slots(n, size):
    """-> (rows,size) positions in the serial order. Short clouds: one row of n. Otherwise the last row, where it is not
    full, ends with the same columns of the row before it; only a point's own slot (position p is slot p) gives its result."""
    if n <= size:
        return torch.arange(n)[None]
    rows = (n + size - 1) // size
    slots = torch.arange(rows * size)
    tail = n % size
    if tail:
        slots[(rows - 1) * size + tail:] = slots[(rows - 2) * size + tail:(rows - 1) * size]
    return slots.reshape(rows, size)


def conv_rows(cells, duplicates):
    """(P,3) -> (P,27): the point that each tap of a 3x3x3 submanifold convolution reads (x slowest; tap t reads the cell at
    offset t - 1 per axis), P where there is none.

    Several points may lie in one cell, which a submanifold convolution does not provide for. One point then stands for
    its cell: here that of the highest index (on the GPU: whichever was written last). "all": every point reads its own
    feature at the centre and the standing points of the 26 cells around. "spconv": so does the standing point; the others
    read the first 13 taps and the centre only, because the library fills the last 13 taps from the other side."""
    n = len(cells)
    side = int(cells.max()) + 3
    key = lambda c: ((c[:, 0] + 1) * side + c[:, 1] + 1) * side + c[:, 2] + 1
    cell, member = torch.unique(key(cells), return_inverse=True)
    standing = torch.argsort(member, stable=True)[torch.bincount(member).cumsum(0) - 1]     # the last of each cell
    rows = torch.full((n, 27), n)
    for tap in range(27):
        step = torch.tensor([tap // 9 - 1, tap // 3 % 3 - 1, tap % 3 - 1])
        want = key(cells + step)
        at = torch.searchsorted(cell, want).clamp(max=len(cell) - 1)
        rows[:, tap] = torch.where(cell[at] == want, standing[at], torch.full_like(at, n))
    rows[:, 13] = torch.arange(n)
    if duplicates == "spconv":
        rows[:, 14:][standing[member] != torch.arange(n)] = n
    return rows
