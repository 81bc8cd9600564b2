#!/usr/bin/env python3
"""Speaks to a Tactus probe, with nothing but Python and wire.json, which lies beside this file.

    client.py tcp:127.0.0.1:7429 Status
    client.py /dev/ttyACM0 Identify '{"threshold": 0.99, "max_slides": 10}'

Prints each report as a line of JSON. Exit code 0: the probe has done it; 1: it refuses; 2: line or version is no good.
"""
import binascii, json, os, socket, struct, sys, tty

SCHEMA = json.load(open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "wire.json")))
PACKED = {"bool": "<?", "u8": "<B", "i8": "<b", "f32": "<f", "f64": "<d"}


def parts(kind):
    """The types of a tuple or an array."""
    return kind["tuple"] if "tuple" in kind else [kind["array"]] * kind["length"]


def read(kind, data, at=0):
    """The value of a type in the bytes from `at` on, and where it ends."""
    if kind in list(PACKED):
        return struct.unpack_from(PACKED[kind], data, at)[0], at + struct.calcsize(PACKED[kind])
    if isinstance(kind, str) and kind in SCHEMA["types"]:
        return read(SCHEMA["types"][kind], data, at)
    if isinstance(kind, str):  # whole numbers, seven bits a byte, the lowest first; a text is its length and its bytes
        value = shift = 0
        while True:
            byte, at = data[at], at + 1
            value, shift = value | (byte & 127) << shift, shift + 7
            if byte < 128:
                break
        if kind == "string":
            return bytes(data[at:at + value]).decode(), at + value
        return (value >> 1) ^ -(value & 1) if kind[0] == "i" else value, at
    if "option" in kind:
        return read(kind["option"], data, at + 1) if data[at] else (None, at + 1)
    if "enum" in kind:
        number, at = read("u32", data, at)
        variant = kind["enum"][number]
        if "holds" not in variant:
            return variant["name"], at
        value, at = read(variant["holds"], data, at)
        return {variant["name"]: value}, at
    if "struct" in kind:
        value = {}
        for field in kind["struct"]:
            value[field["name"]], at = read(field["type"], data, at)
        return value, at
    values, kinds = [], None
    if "seq" in kind:
        count, at = read("u32", data, at)
        kinds = [kind["seq"]] * count
    for one in kinds if kinds is not None else parts(kind):
        value, at = read(one, data, at)
        values.append(value)
    return values, at


def write(kind, value):
    """The bytes of a value of a type; what is not given is 0, false, empty or None."""
    if kind in list(PACKED):
        return struct.pack(PACKED[kind], value or 0)
    if isinstance(kind, str) and kind in SCHEMA["types"]:
        return write(SCHEMA["types"][kind], value)
    if isinstance(kind, str):
        text = (value or "").encode() if kind == "string" else b""
        number = len(text) if kind == "string" else value or 0
        if kind[0] == "i":
            number = number * 2 if number >= 0 else -2 * number - 1
        head = bytearray()
        while number > 127:
            head.append(number & 127 | 128)
            number >>= 7
        return bytes(head) + bytes([number]) + text
    if "option" in kind:
        return b"\0" if value is None else b"\1" + write(kind["option"], value)
    if "enum" in kind:
        name, held = next(iter(value.items())) if isinstance(value, dict) else (value, None)
        number = 0 if name is None else [variant["name"] for variant in kind["enum"]].index(name)
        return write("u32", number) + write(kind["enum"][number].get("holds", {"tuple": []}), held)
    if "struct" in kind:
        return b"".join(write(field["type"], (value or {}).get(field["name"])) for field in kind["struct"])
    if "seq" in kind:
        return write("u32", len(value or [])) + b"".join(write(kind["seq"], one) for one in value or [])
    return b"".join(write(one, part) for one, part in zip(parts(kind), value or [None] * len(parts(kind))))


def frame(message):
    """COBS of a message and its CRC-32, and the closing 0."""
    out = bytearray()
    for part in (message + struct.pack("<I", binascii.crc32(message))).split(b"\0"):
        while len(part) >= 254:
            out, part = out + b"\xff" + part[:254], part[254:]
        out += bytes([len(part) + 1]) + part
    return bytes(out) + b"\0"


def message(data):
    """The message of a frame without its closing 0; None where it is damaged."""
    whole, at = bytearray(), 0
    while at < len(data):
        whole += data[at + 1:at + data[at]]
        code, at = data[at], at + data[at]
        if code < 255 and at < len(data):
            whole.append(0)
    return bytes(whole[:-4]) if binascii.crc32(whole[:-4]) == int.from_bytes(whole[-4:], "little") else None


def main(port, command, held=None):
    if port.startswith("tcp:"):
        line = socket.create_connection(port[4:].rsplit(":", 1)).makefile("rwb", buffering=0)
    else:
        line = open(port, "r+b", buffering=0)
        tty.setraw(line)
        os.system(f"stty -F {port} 921600")
    request = {"id": 1, "command": {command: json.loads(held)} if held else command}
    line.write(b"\0" + frame(write("Request", request)))
    rest = b""
    while came := line.read(4096):
        *frames, rest = (rest + came).split(b"\0")
        for whole in map(message, filter(None, frames)):
            if whole is None:
                print("a frame is damaged", file=sys.stderr)
                continue
            report = read("Report", whole)[0]
            print(json.dumps(report), flush=True)
            event = report["event"] if isinstance(report["event"], dict) else {}
            if event.get("Booted", SCHEMA)["protocol"] != SCHEMA["protocol"]:
                sys.exit("the probe speaks another version of the messages: take the wire.json of its firmware")
            if event.get("Done") == 1 or event.get("Refused", {"id": 0})["id"] == 1:
                return 0 if "Done" in event else 1
    print("the probe has closed the line", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]) if len(sys.argv) in (3, 4) else __doc__)
