#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests docs/examples/Caddyfile and nginx.conf: lenticule web behind a reverse proxy, with HTTPS.

Usage: tests/browser/reverse_proxy_test.py BUILD_FOLDER

Changes only the name of the site, the path of the socket, and the certificate, which is made for the test.
"""

import json
import os
import pathlib
import re
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
LIMIT_S = 60
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Site:
    def __init__(self, base):
        self.base = base
        self.context = ssl.create_default_context()
        self.context.check_hostname = False
        self.context.verify_mode = ssl.CERT_NONE

    def ask(self, method, path, **headers):
        """Returns (status, headers, body)."""
        names = {name.replace("_", "-"): value for name, value in headers.items()}
        data = b"" if method == "POST" else None
        request = urllib.request.Request(self.base + path, method=method, headers=names, data=data)
        try:
            with urllib.request.urlopen(request, context=self.context, timeout=20) as answer:
                return answer.status, answer.headers, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.headers, error.read()


def wait_for(condition, what):
    deadline = time.monotonic() + LIMIT_S
    while time.monotonic() < deadline:
        try:
            if condition():
                return
        except OSError:
            pass
        time.sleep(0.1)
    raise SystemExit(f"did not come true: {what}")


def expect(seen, wanted, what):
    if seen != wanted:
        raise SystemExit(f"{what}: expected {wanted}, got {seen}")
    print(f"ok: {what}")


def check(program, folder, site):
    wait_for(lambda: site.ask("GET", "/style.css")[0] == 200, "the proxy passes requests on")
    expect(site.ask("GET", "/")[0], 401, "no page without a token")
    address = subprocess.run([program, "web", "address", "--state", folder + "/state", "--base", site.base],
                             check=True, capture_output=True, text=True).stdout.splitlines()[0]
    status, headers, _ = site.ask("GET", address[len(site.base):])
    expect(status, 200, "the address with the token")
    cookie = headers["Set-Cookie"]
    expect("; Secure" in cookie and "HttpOnly" in cookie, True, "the cookie is sent over HTTPS only")
    cookie = cookie.split(";")[0]
    status, _, body = site.ask("GET", "/api/v1/state", Cookie=cookie)
    expect((status, json.loads(body)["rights"]), (200, "change"), "the cookie is the token's")
    expect(site.ask("POST", "/api/v1/pause", Cookie=cookie, Origin=site.base)[0], 502,
           "a change by a page of this site reaches the player, which does not run")
    expect(site.ask("POST", "/api/v1/pause", Cookie=cookie, Origin="https://evil.example")[0], 403,
           "a change by a page of another site is refused")
    statuses = [site.ask("GET", "/", Authorization="Bearer no")[0] for _ in range(12)]
    expect(statuses[-1], 429, "guessing is slowed down behind the proxy, too")
    statuses = [site.ask("GET", "/", Authorization="Bearer no", X_Forwarded_For="9.9.9.9")[0] for _ in range(2)]
    expect(statuses, [429, 429], "a forged X-Forwarded-For does not help")


def replaced(text, *changes):
    """Returns the text with each pattern replaced, which must be there once."""
    for pattern, by in changes:
        text, count = re.subn(r"(?m)" + pattern, by, text)
        expect(count, 1, f"the example has {pattern}")
    return text


def start_caddy(folder, port):
    text = replaced((ROOT / "docs/examples/Caddyfile").read_text(encoding="utf-8"),
                    (r"^panel\.example \{", f"https://localhost:{port} {{\n\ttls internal"),
                    (r"unix//run/lenticule-web/lobby\.sock$", f"unix/{folder}/web.sock"))
    options = "{\n\tadmin off\n\tskip_install_trust\n\tauto_https disable_redirects\n}\n"
    pathlib.Path(folder, "Caddyfile").write_text(options + text, encoding="utf-8")
    home = dict(os.environ, HOME=folder, XDG_DATA_HOME=folder, XDG_CONFIG_HOME=folder)
    return subprocess.Popen(["caddy", "run", "--config", folder + "/Caddyfile", "--adapter", "caddyfile"],
                            env=home, **QUIET)


def start_nginx(folder, port):
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost", "-days", "1",
                    "-keyout", folder + "/key", "-out", folder + "/certificate"], check=True, **QUIET)
    site = replaced((ROOT / "docs/examples/nginx.conf").read_text(encoding="utf-8"),
                    (r"listen 443 ssl", f"listen 127.0.0.1:{port} ssl"), (r"server_name panel\.example", "server_name localhost"),
                    (r"/etc/ssl/certs/panel\.example\.pem", folder + "/certificate"),
                    (r"/etc/ssl/private/panel\.example\.key", folder + "/key"),
                    (r"http://unix:/run/lenticule-web/lobby\.sock", f"http://unix:{folder}/web.sock"))
    user = "user root;\n" if os.geteuid() == 0 else ""
    folders = "".join(f"{name}_temp_path {folder}/{name};\n" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    pathlib.Path(folder, "nginx.conf").write_text(
        f"{user}daemon off;\npid {folder}/nginx.pid;\nerror_log {folder}/nginx.log;\nevents {{}}\n"
        f"http {{\naccess_log off;\n{folders}{site}}}\n", encoding="utf-8")
    nginx = shutil.which("nginx") or "/usr/sbin/nginx"
    return subprocess.Popen([nginx, "-e", folder + "/nginx.log", "-c", folder + "/nginx.conf"], **QUIET)


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve() / "lenticule")
    for name, start in (("caddy", start_caddy), ("nginx", start_nginx)):
        print(f"== {name}")
        with tempfile.TemporaryDirectory() as folder:
            port = free_port()
            web = subprocess.Popen([program, "web", "--socket", folder + "/no-player.sock", "--state",
                                    folder + "/state", "--unix", folder + "/web.sock"], **QUIET)
            wait_for(lambda: os.path.exists(folder + "/web.sock"), "the server listens")
            proxy = start(folder, port)
            try:
                check(program, folder, Site(f"https://localhost:{port}"))
            finally:
                for process in (proxy, web):
                    process.terminate()
                    process.wait(20)


main()
