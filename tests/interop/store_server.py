"""An S3 server on loopback (moto) behind a small proxy that counts what is transferred and makes trouble when asked to."""

import logging
import os
import socket
import struct
import threading
import time
from contextlib import contextmanager
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import boto3
from moto.server import ThreadedMotoServer

BUCKET = "fleet"
logging.getLogger("werkzeug").setLevel(logging.ERROR)


class Proxy(ThreadingHTTPServer):
    """Passes requests on. `trouble(handler)` is asked before each, and returns None or one of error, cut, slow, hang."""

    daemon_threads = True
    request_queue_size = 256

    def __init__(self, port):
        self.target = port
        self.trouble = lambda request: None
        self.lock = threading.Lock()
        self.reset()
        super().__init__(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def reset(self):
        with self.lock:
            self.requests, self.sent, self.received = [], 0, 0

    @property
    def port(self):
        return self.server_address[1]

    def handle_error(self, request, client_address):
        """Clients that are killed are part of the tests."""


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def log_message(self, *_):
        pass

    def forward(self):
        proxy = self.server
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        if self.headers.get("Transfer-Encoding") == "chunked":
            while size := int(self.rfile.readline().split(b";")[0], 16):
                body += self.rfile.read(size)
                self.rfile.readline()
            self.rfile.readline()
        with proxy.lock:
            proxy.requests.append((self.command, self.path, self.headers.get("Range")))
            proxy.received += len(body)
            trouble = proxy.trouble(self)
        if trouble == "error":
            self.send_response(503)
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        if trouble == "lost":
            # Nothing of the request arrives.
            self.cut()
            return
        if trouble == "hang":
            time.sleep(3600)
        upstream = HTTPConnection("127.0.0.1", proxy.target)
        skipped = {"connection", "transfer-encoding", "accept-encoding", "content-length"}
        headers = {key: value for key, value in self.headers.items() if key.lower() not in skipped}
        # moto serves whole objects to whoever asks for their size.
        if body or self.command in ("PUT", "POST"):
            headers["Content-Length"] = str(len(body))
        upstream.request(self.command, self.path, body, headers)
        answer = upstream.getresponse()
        content = answer.read()
        if trouble == "unanswered":
            # It was done, but nobody hears of it.
            self.cut()
            return
        self.send_response(answer.status)
        for key, value in answer.getheaders():
            if key.lower() not in ("connection", "transfer-encoding", "content-length", "date", "server"):
                self.send_header(key, value)
        length = answer.getheader("Content-Length") if self.command == "HEAD" else len(content)
        self.send_header("Content-Length", str(length or 0))
        self.end_headers()
        if self.command == "HEAD":
            return
        with proxy.lock:
            proxy.sent += len(content)
        if trouble == "cut":
            self.wfile.write(content[: len(content) // 2])
            self.wfile.flush()
            self.cut()
        elif trouble == "slow":
            step = max(1, len(content) // 4)
            for at in range(0, len(content), step):
                time.sleep(0.1)
                self.wfile.write(content[at : at + step])
        else:
            self.wfile.write(content)

    def cut(self):
        """Resets the connection, as a network does that breaks."""
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.close_connection = True
        self.connection.close()

    do_GET = do_PUT = do_POST = do_HEAD = do_DELETE = forward


class Store:
    """The server, the proxy in front of it, and a client that goes past the proxy."""

    def __init__(self):
        self.server = ThreadedMotoServer(port=0, verbose=False)
        self.server.start()
        self.server_port = self.server.get_host_and_port()[1]
        self.proxy = Proxy(self.server_port)
        os.environ.update(AWS_ACCESS_KEY_ID="test", AWS_SECRET_ACCESS_KEY="test", AWS_REGION="us-east-1")
        self.client = boto3.client("s3", endpoint_url=f"http://127.0.0.1:{self.server_port}", region_name="us-east-1")
        self.client.create_bucket(Bucket=BUCKET)

    def environment(self, past_proxy=False, **more):
        port = self.server_port if past_proxy else self.proxy.port
        url = f"http://127.0.0.1:{port}"
        return {**os.environ, "AWS_ENDPOINT_URL": url, "AWS_ALLOW_HTTP": "true", "STILLPOINT_RETRY_S": "20", **more}

    def put(self, key, content):
        self.client.put_object(Bucket=BUCKET, Key=key, Body=content)

    def get(self, key):
        return self.client.get_object(Bucket=BUCKET, Key=key)["Body"].read()

    def keys(self, prefix=""):
        pages = self.client.get_paginator("list_objects_v2").paginate(Bucket=BUCKET, Prefix=prefix)
        return [entry["Key"] for page in pages for entry in page.get("Contents", [])]

    def unfinished(self):
        return self.client.list_multipart_uploads(Bucket=BUCKET).get("Uploads", [])

    @contextmanager
    def trouble(self, trouble):
        self.proxy.trouble = trouble
        try:
            yield
        finally:
            self.proxy.trouble = lambda request: None

    def stop(self):
        self.proxy.shutdown()
        self.server.stop()
