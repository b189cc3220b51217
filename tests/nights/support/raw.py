"""Raw bytes over a connection, and the statuses that come back."""

import json
import re
import socket

STATUS = re.compile(rb"HTTP/1\.[01] (\d{3})")


class Talk:
    """One client of the service."""

    def __init__(self, service, timeout=60):
        self.service, self.timeout = service, timeout

    def connect(self):
        connection = socket.create_connection((self.service.host, self.service.port), timeout=self.timeout)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection

    def raw(self, data, shut=False):
        """Sends bytes; the status of the first answer, or None if the connection ends without one."""
        with self.connect() as connection:
            try:
                for start in range(0, len(data), 1 << 16):
                    connection.sendall(data[start : start + (1 << 16)])
                if shut:
                    connection.shutdown(socket.SHUT_WR)
            except OSError:
                pass  # Refused before the end: the answer may be there all the same.
            return self.status(connection)

    def status(self, connection):
        """The status of the next final answer."""
        received = b""
        try:
            while len(received) < 1 << 16:
                for found in STATUS.finditer(received):
                    if int(found[1]) >= 200:
                        return int(found[1])
                piece = connection.recv(1 << 16)
                if not piece:
                    return None
                received += piece
        except OSError:
            pass
        return None

    def request(self, line, headers=(), body=b"", host="localhost", shut=False):
        """A request of HTTP/1.1 with `line` as its method and target, closed after the answer."""
        if isinstance(line, str):
            line = line.encode()
        if isinstance(body, (dict, list)):
            body = json.dumps(body).encode()
        data = line + b" HTTP/1.1\r\n"
        if host is not None:
            data += b"host: " + host.encode() + b"\r\n"
        for header in headers:
            data += (header if isinstance(header, bytes) else header.encode()) + b"\r\n"
        lengths = (b"content-length", b"transfer-encoding")
        named = any(part.split(b":")[0].strip().lower() in lengths for part in data.split(b"\r\n"))
        if body and not named:
            data += b"content-length: %d\r\n" % len(body)
        return self.raw(data + b"connection: close\r\n\r\n" + body, shut)

    def json(self, path, body):
        """A JSON body by POST."""
        return self.request(f"POST {path}", ["content-type: application/json"], body)
