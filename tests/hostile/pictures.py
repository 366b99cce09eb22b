"""Pictures that claim to be huge, that contain more than they show, or that take very long to decode; and bytes that are no picture."""
import os
import struct
import zlib

from views import Copy

SIDE_MOST = 16384  # the largest permitted picture, as a square


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, packed, depth=8, colour=2, interlaced=0, more=b""):
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, interlaced)) + more
            + (chunk(b"IDAT", packed) if packed else b"") + chunk(b"IEND", b""))


def zeros(size):
    """Deflated zeros: a megabyte, compressed independently of what precedes it, repeated."""
    def packed(count, flush):
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        return packer.compress(b"\0" * count) + packer.flush(flush)
    many, rest = divmod(size, 1 << 20)
    return b"\x78\x9c" + packed(1 << 20, zlib.Z_FULL_FLUSH) * many + packed(rest, zlib.Z_FINISH) + struct.pack(">HH", size % 65521, 1)


def rows(width, height, depth, colour):
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    return height * (1 + (width * channels * depth + 7) // 8)


def interlaced_rows(width, height, depth, colour):
    total = 0
    for x0, y0, dx, dy in ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)):
        w, h = max(0, -(-(width - x0) // dx)), max(0, -(-(height - y0) // dy))
        total += rows(w, h, depth, colour) if w and h else 0
    return total


def pngs(maker, put):
    choose, number = maker.random.choice, maker.random.randint
    side = number(12000, SIDE_MOST)
    put("claims", "png", png(SIDE_MOST, SIDE_MOST, zeros(1 << 20), choose((8, 16)), 6))
    put("claims_beyond", "png", png(choose((2**31 - 1, 65536, 200_000)), choose((2**31 - 1, 65536)), zeros(1000)))
    put("zero_size", "png", png(0, number(0, 9), zeros(10)))
    put("grey_1_bit", "png", png(side, side, zeros(rows(side, side, 1, 0)), 1, 0))
    palette = chunk(b"PLTE", b"\0\0\0\xff\xff\xff") + chunk(b"tRNS", b"\xff\x80")
    put("palette_interlaced", "png", png(side, side, zeros(interlaced_rows(side, side, 1, 3)), 1, 3, 1, palette))
    put("wide", "png", png(65535, number(2000, 4096), zeros(rows(65535, 4096, 8, 0)), 8, 0))
    side = number(6000, 8000)
    put("interlaced_16_bit", "png", png(side, side, zeros(interlaced_rows(side, side, 16, 6)), 16, 6, 1))
    side = number(20, 80)
    sound = zeros(rows(side, side, 8, 2))
    bomb = zeros(number(200, 400) << 20)
    put("profile", "png", png(side, side, sound, more=chunk(b"iCCP", b"a\0\0" + bomb)), side)
    put("text", "png", png(side, side, sound, more=chunk(b"zTXt", b"a\0\0" + bomb) * 2), side)
    put("many_texts", "png", png(side, side, sound, more=chunk(b"tEXt", b"a\0b") * number(100_000, 300_000)), side)
    put("text_escape", "png", png(side, side, sound, more=chunk(b"tEXt", b"Comment\0" + maker.escape().encode())), side)
    put("too_much", "png", png(side, side, zeros(100 << 20)), side)
    put("cut", "png", png(side, side, sound)[:number(9, 60)], side)
    put("wrong_crc", "png", png(side, side, sound).replace(b"IEND\xaeB`\x82", b"IEND\0\0\0\0"), side)
    put("chunk_length", "png", png(side, side, sound)[:33] + struct.pack(">I", choose((2**31, 2**32 - 1, 2**31 - 1))) + b"IDAT", side)


def jpeg(width, height, scans, progressive=True):
    """A single component whose blocks are all empty: a scan of a few bytes that visits the whole picture."""
    segment = lambda marker, data: struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data
    table = lambda kind, code: segment(0xC4, bytes([kind]) + bytes([1] + [0] * 15) + bytes([code]))
    out = b"\xff\xd8" + segment(0xDB, b"\0" + b"\1" * 64)
    out += segment(0xC2 if progressive else 0xC0, struct.pack(">BHHB", 8, height, width, 1) + b"\1\x11\0")
    # 0xE0: the end of a band for 2^14 blocks and more; 14 bits of it follow.
    out += table(0x00, 0) + table(0x10, 0xE0)
    blocks = -(-width // 8) * -(-height // 8)
    dc = b"\0" * (-(-blocks // 8))
    first = segment(0xDA, bytes([1, 1, 0, 0, 0, 0x00])) + dc
    runs = -(-blocks // 16384)
    bits = 15 * runs
    ac = b"\0" * (bits // 8) + (bytes([(1 << 8 - bits % 8) - 1]) if bits % 8 else b"")
    one = segment(0xDA, bytes([1, 1, 0, 1, 63, 0x0D])) + ac
    out += first + one * min(scans, 1)
    for i in range(scans - 1):
        bits = 0xDC - 0x11 * (i % 13)
        out += segment(0xDA, bytes([1, 1, 0, 1, 63, bits])) + ac
    return out + b"\xff\xd9"


def jpegs(maker, put):
    number = maker.random.randint
    put("many_scans", "jpg", jpeg(number(3000, 4096), number(3000, 4096), number(3000, 6000)))
    put("many_small_scans", "jpg", jpeg(256, 256, number(40_000, 80_000)))
    put("progressive_huge", "jpg", jpeg(SIDE_MOST, number(15000, SIDE_MOST) * 3 // 5, number(3, 14)))  # larger ones are only slow
    put("claims", "jpg", jpeg(65535, number(60_000, 65535), 1)[:number(1000, 20_000)])
    put("cut", "jpg", jpeg(64, 64, 3)[:number(20, 100)], 64)
    put("no_tables", "jpg", b"\xff\xd8\xff\xc0\0\x0b\x08\0\x40\0\x40\1\1\x11\0\xff\xda\0\x08\1\1\0\0\x3f\0\0\0\xff\xd9", 64)
    exif = b"Exif\0\0MM\0*\0\0\0\x08" + b"\xff\xff" + b"\x01\x12\0\3\xff\xff\xff\xff\xff\xff\xff\xff" * 20
    put("exif", "jpg", b"\xff\xd8\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg(64, 64, 2)[2:], 64)


def exr(width, height, compression, tail=b"", lines=16, tiles=None, more=b""):
    attribute = lambda name, kind, data: name + b"\0" + kind + b"\0" + struct.pack("<I", len(data)) + data
    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", 1, 0, 1, 1) for name in (b"A", b"B", b"G", b"R")) + b"\0"
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    out = struct.pack("<II", 20000630, 2 | (0x200 if tiles else 0)) + attribute(b"channels", b"chlist", channels) + attribute(b"compression", b"compression", bytes([compression]))
    out += attribute(b"dataWindow", b"box2i", box) + attribute(b"displayWindow", b"box2i", box) + attribute(b"lineOrder", b"lineOrder", b"\0")
    out += attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1)) + attribute(b"screenWindowCenter", b"v2f", b"\0" * 8) + attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1))
    out += (attribute(b"tiles", b"tiledesc", struct.pack("<IIB", *tiles)) if tiles else b"") + more + b"\0"
    count = -(-height // lines)
    return out + b"\0" * (8 * min(count, 1 << 16)) + tail


def exrs(maker, put):
    number = maker.random.randint
    side = number(12000, SIDE_MOST)
    for kind, compression, lines in (("none", 0, 1), ("rle", 1, 1), ("zip", 3, 16), ("piz", 4, 32), ("dwaa", 8, 32), ("dwab", 9, 256)):
        put(f"{kind}_empty", "exr", exr(side, side, compression, lines=lines))
    put("dwab_junk", "exr", exr(side, side, 9, bytes(maker.random.randrange(256) for _ in range(50_000)), 256))
    put("beyond", "exr", exr(2**31 - 1, 2**31 - 1, 3))
    put("tiles", "exr", exr(SIDE_MOST, SIDE_MOST, 3, tiles=(1, 1, maker.random.choice((0, 1, 2))), lines=1))
    put("text_escape", "exr", exr(64, 64, 3, more=b"comments\0string\0" + struct.pack("<I", 12) + b"\x1b]0;owned\x07ab"), 64)
    put("attribute_length", "exr", exr(64, 64, 3, more=b"a\0string\0" + struct.pack("<I", maker.random.choice((2**31 - 1, 2**32 - 1, 2**30)))), 64)
    put("cut", "exr", exr(64, 64, 3)[:number(8, 300)], 64)


def tiff(width, height, compression=1, rows_per_strip=None, entries=(), data=b"\0" * 64, bits=8, channels=3):
    """A single strip, whose bytes are at 8."""
    def entry(tag, kind, count, value):
        return struct.pack("<HHII", tag, kind, count, value)
    strip = entry(256, 4, 1, width) + entry(257, 4, 1, height) + entry(258, 3, 1, bits) + entry(259, 3, 1, compression) + entry(262, 3, 1, 2 if channels == 3 else 1)
    strip += entry(273, 4, 1, 8) + entry(277, 3, 1, channels) + entry(278, 4, 1, rows_per_strip or height) + entry(279, 4, 1, len(data))
    fields = [strip[i:i + 12] for i in range(0, len(strip), 12)] + list(entries)
    fields.sort(key=lambda e: struct.unpack("<H", e[:2])[0])
    return b"II*\0" + struct.pack("<I", 8 + len(data)) + data + struct.pack("<H", len(fields)) + b"".join(fields) + b"\0\0\0\0"


def tiffs(maker, put):
    number, choose = maker.random.randint, maker.random.choice
    packed = zeros(100 << 20)
    put("deflate", "tif", tiff(SIDE_MOST, SIDE_MOST, 8, data=packed))
    put("strip_huge", "tif", tiff(SIDE_MOST, SIDE_MOST, 1))
    put("packbits", "tif", tiff(SIDE_MOST, 4096, 32773, data=b"\x81\0" * number(10_000, 50_000)))
    put("beyond", "tif", tiff(2**32 - 1, choose((2**31, 2**32 - 1))))
    put("strip_length", "tif", tiff(64, 64).replace(struct.pack("<HHII", 279, 4, 1, 64), struct.pack("<HHII", 279, 4, 1, 2**32 - 1)), 64)
    put("bits", "tif", tiff(64, 64, bits=choose((0, 7, 65535))), 64)
    put("channels", "tif", tiff(64, 64, channels=65535), 64)
    put("tiles_huge", "tif", tiff(SIDE_MOST, SIDE_MOST, 8, entries=[struct.pack("<HHII", 322, 4, 1, 2**31 - 16), struct.pack("<HHII", 323, 4, 1, 2**31 - 16)]))
    put("entry_count", "tif", tiff(64, 64, entries=[struct.pack("<HHII", 700, 1, 2**32 - 1, 8)]), 64)
    put("text_escape", "tif", tiff(64, 64, entries=[struct.pack("<HHII", 270, 2, 4, struct.unpack("<I", b"\x1b[2J")[0])]), 64)
    data = tiff(64, 64)
    put("loop", "tif", data[:-4] + struct.pack("<I", struct.unpack("<I", data[4:8])[0]), 64)
    put("cut", "tif", data[:number(8, len(data) - 1)], 64)


def webps(maker, put):
    number = maker.random.randint
    riff = lambda body: b"RIFF" + struct.pack("<I", 4 + len(body)) + b"WEBP" + body
    lossless = lambda width, height, data: b"\x2f" + struct.pack("<I", (width - 1) | (height - 1) << 14) + data
    piece = lambda kind, data: kind + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)
    junk = lambda n: bytes(maker.random.randrange(256) for _ in range(n))
    put("lossless_claims", "webp", riff(piece(b"VP8L", lossless(SIDE_MOST - 1, SIDE_MOST - 1, b"\0" * 200))))
    put("lossless_junk", "webp", riff(piece(b"VP8L", lossless(SIDE_MOST - 1, SIDE_MOST - 1, junk(20_000)))))
    put("lossy_claims", "webp", riff(piece(b"VP8 ", b"\x30\x01\0\x9d\x01\x2a" + struct.pack("<HH", 16383, 16383) + b"\0" * 5000)))
    canvas = piece(b"VP8X", b"\x12\0\0\0" + struct.pack("<I", 2**24 - 1)[:3] * 2)
    put("canvas", "webp", riff(canvas + piece(b"VP8L", lossless(16, 16, b"\0" * 50))))
    frame = lambda: piece(b"ANMF", b"\0" * 6 + struct.pack("<I", 15)[:3] * 2 + b"\0" * 4 + piece(b"VP8L", lossless(16, 16, b"\0" * 20)))
    put("animation", "webp", riff(piece(b"VP8X", b"\x12\0\0\0" + struct.pack("<I", SIDE_MOST - 2)[:3] * 2) + piece(b"ANIM", b"\0" * 6) + frame() * number(10_000, 30_000)))
    put("chunk_length", "webp", b"RIFF\xff\xff\xff\xffWEBPVP8L\xff\xff\xff\xff" + lossless(64, 64, b"\0" * 30), 64)
    put("cut", "webp", riff(piece(b"VP8L", lossless(64, 64, b"\0" * 30)))[:number(13, 40)], 64)


def bmps(maker, put):
    def bmp(width, height, bits=24, compression=0, data=b"", offset=54):
        return b"BM" + struct.pack("<IHHI", offset + len(data) & 0xffffffff, 0, 0, offset) + struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, compression, 0, 0, 0, 0, 0) + data
    choose = maker.random.choice
    put("claims", "bmp", bmp(SIDE_MOST, choose((-1, 1)) * SIDE_MOST))
    put("beyond", "bmp", bmp(2**31 - 1, choose((2**31 - 1, -2**31))))
    put("negative", "bmp", bmp(-choose((1, 16, 2**31)), 16, data=b"\0" * 1000))
    put("palette", "bmp", bmp(64, 64, choose((1, 4, 8)), data=b"\xff" * 900), 64)
    put("rle", "bmp", bmp(SIDE_MOST, SIDE_MOST, 8, 1, data=b"\0" * 1024 + b"\xff\0" * 1000 + b"\0\1"))
    put("offset", "bmp", bmp(64, 64, data=b"\0" * 12288, offset=choose((0, 2**31 - 1, 2**32 - 1))), 64)
    put("cut", "bmp", bmp(64, 64, data=b"\0" * 12288)[:maker.random.randint(2, 3000)], 64)


def make(maker):
    def put(kind, ending, content, side=None):
        """Beside sound pictures, as the first of an object's; the list of cameras states no size if the file claims one of its own."""
        copy = Copy(maker, f"{ending}/{kind}", names=f"{ending}/{kind}")
        name = f"images/{maker.word()}.{ending}"
        maker.write(copy.path(name), content)
        for field in ("w", "h", "cx", "cy"):
            copy.data.pop(field, None)
        copy.data["camera_angle_x"] = 0.8
        for field in ("fl_x", "fl_y"):
            copy.data.pop(field, None)
        copy.first(file_path=name)
        if side is None:  # also as a mask
            copy = Copy(maker, f"{ending}/{kind}_mask", names=f"{ending}/{kind}_mask")
            maker.write(copy.path(name), content)
            copy.first(mask_path=name)
    for formats in (pngs, jpegs, exrs, tiffs, webps, bmps):
        formats(maker, put)
    for ending in ("png", "jpg", "exr", "tif", "webp", "bmp"):
        put("junk", ending, bytes(maker.random.randrange(256) for _ in range(500)), 64)
        put("empty", ending, b"", 64)
    # A bad input picture is also bad as a picture to compare with.
    for kind in ("claims", "grey_1_bit", "cut"):
        source = os.path.join(maker.out, "png", kind, "images")
        name = next(n for n in os.listdir(source) if not n.startswith("00"))
        copy = Copy(maker, f"compare/{kind}", "compare", "0000.png")
        os.remove(copy.path("images", "0000.png"))
        os.link(os.path.join(source, name), copy.path("images", "0000.png"))
