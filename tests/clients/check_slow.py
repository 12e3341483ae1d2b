"""Called by check_slow.sh: many slow connections, and a whole request among them. Exits with 1 at the
first thing that is wrong."""

import re
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
from urllib.parse import urlsplit

SLOW = 500
WITHIN_S = 1.0
ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+/[0-9a-f]{32}/")


def started(program, log, folder):
    """Starts a run in real time; returns the process and the address of its page."""
    command = [program, "run", log, "-o", folder, "--serve", "--realtime"]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    for line in child.stderr:
        found = ADDRESS.search(line)
        if found:
            # What is said later must not fill the pipe.
            threading.Thread(target=child.stderr.read, daemon=True).start()
            return child, urlsplit(found.group())
    sys.exit(f"the program ended with {child.wait()} before it said its address")


def request(address):
    return f"GET {address.path} HTTP/1.1\r\nHost: {address.netloc}\r\nConnection: close\r\n\r\n".encode()


def half(address):
    """A connection that has sent half a request."""
    stream = socket.create_connection((address.hostname, address.port), timeout=10)
    whole = request(address)
    stream.sendall(whole[: len(whole) // 2])
    return stream


def answered(address):
    """Asks for the page; returns the first line of the answer, and the time until all of it is there."""
    start = time.monotonic()
    with socket.create_connection((address.hostname, address.port), timeout=10) as stream:
        stream.sendall(request(address))
        parts = []
        while part := stream.recv(1 << 16):
            parts.append(part)
    return b"".join(parts).split(b"\r\n", 1)[0].decode(), time.monotonic() - start


def check(address, held, when):
    status, took_s = answered(address)
    assert status.startswith("HTTP/1.1 200"), f"{when}: {status}"
    assert took_s < WITHIN_S, f"{when}: {held} slow connections, answered after {took_s:.2f} s"
    print(f"{when}: answered after {1e3 * took_s:.0f} ms: ok")


def main():
    program, log, folder = sys.argv[1:]
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard if hard < 4096 else 4096, hard))
    child, address = started(program, log, folder)
    try:
        check(address, 0, "alone")
        slow = [half(address) for _ in range(SLOW)]
        check(address, SLOW, f"beside {SLOW} halves of requests")
        # One more byte each, so that they are not taken for silent.
        for stream in slow:
            stream.sendall(b"x")
        check(address, SLOW, "after a further byte of each")
        for stream in slow:
            stream.close()
        check(address, 0, "after they are closed")
    finally:
        child.send_signal(signal.SIGINT)
        child.wait(timeout=30)


main()
