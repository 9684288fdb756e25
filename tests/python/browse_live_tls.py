"""Looks on at a run over TLS, in Chromium and with Python's own ssl, and says as JSON what happened.

    python browse_live_tls.py CHROMIUM FOLDER mapper run CAMPAIGN --out RUNS --pace 60

Makes a certificate of its own in FOLDER. The page is served on all addresses, as a stand in a network would.
"""

import atexit
import datetime
import http.client
import ipaddress
import json
import re
import socket
import ssl
import subprocess
import sys
import threading
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from playwright.sync_api import sync_playwright

from chromium import launched

chromium, folder, command = sys.argv[1], Path(sys.argv[2]), sys.argv[3:]
result = {}


def certificate(name):
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "stand")])
    now = datetime.datetime.now(datetime.timezone.utc)
    made = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=30))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), critical=False)
        .sign(key, hashes.SHA256())
    )
    pem, secret = folder / f"{name}.pem", folder / f"{name}.key"
    pem.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    secret.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return str(pem), str(secret)


own, other = certificate("own"), certificate("other")


def refused(*options):
    """What the program says of files that are of no use, before it touches the rig."""
    done = subprocess.run([*command, *options], capture_output=True, text=True, timeout=60)
    return [done.returncode, done.stderr]


live = "--live=0.0.0.0:0"
result["refused"] = {
    "no such file": refused(live, "--live-cert", str(folder / "none.pem"), "--live-key", own[1]),
    "a key as certificate": refused(live, "--live-cert", own[1], "--live-key", own[1]),
    "a certificate as key": refused(live, "--live-cert", own[0], "--live-key", own[0]),
    "another's key": refused(live, "--live-cert", own[0], "--live-key", other[1]),
    "a certificate without a page": refused("--live-cert", own[0], "--live-key", own[1]),
    "a certificate without a key": refused(live, "--live-cert", own[0]),
}


def started(*options):
    run = subprocess.Popen([*command, live, *options, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    # Whatever goes wrong here, the run does not outlive it.
    atexit.register(run.kill)
    printed = []
    for line in run.stderr:
        printed.append(line)
        if line.startswith("live page:"):
            break
    for stream in [run.stderr, run.stdout]:
        threading.Thread(target=stream.read, daemon=True).start()
    return run, re.search(r"(https?)://0\.0\.0\.0:(\d+)/#token=(\w+)", printed[-1]), "".join(printed)


# In clear: one loud warning.
run, _, printed = started()
result["printed_in_clear"] = printed
run.kill()

run, found, printed = started("--live-cert", own[0], "--live-key", own[1])
result["printed_encrypted"], result["scheme"] = printed, found[1]
port, token = int(found[2]), found[3]
trusts = ssl.create_default_context(cafile=own[0])


def asked(method, path, **headers):
    connection = http.client.HTTPSConnection("127.0.0.1", port, context=trusts, timeout=10)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    return connection, answer


connection, answer = asked("GET", "/")
body = answer.read()
result["page"] = [answer.status, b"connect-src 'self'" in body, int(answer.headers["Content-Length"]) == len(body)]
result["without_token"] = asked("GET", "/events")[1].status
_, answer = asked("GET", "/events", Authorization=f"Bearer {token}")
result["with_token"] = [answer.status, answer.readline()[:16].decode()]
bearer = {"Authorization": f"Bearer {token}"}
result["page_in_clear_presses"] = asked("POST", "/ask/stop", Origin=f"http://127.0.0.1:{port}", **bearer)[1].status
# One that does not speak TLS gets nothing, and one that says nothing keeps its place for seconds at most.
with socket.create_connection(("127.0.0.1", port), timeout=20) as clear:
    clear.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    got = clear.recv(4096)
    result["in_clear"] = got.startswith(b"HTTP")
with socket.create_connection(("127.0.0.1", port), timeout=20) as silent:
    result["silent"] = silent.recv(1).decode()
# Nobody is believed whose certificate is another's.
try:
    http.client.HTTPSConnection("127.0.0.1", port, context=ssl.create_default_context(), timeout=10).request("GET", "/")
    result["unknown"] = "believed"
except ssl.SSLCertVerificationError:
    result["unknown"] = "refused"

with sync_playwright() as playwright:
    browser = launched(playwright, chromium)
    page = browser.new_context(ignore_https_errors=True).new_page()
    page.goto(f"https://127.0.0.1:{port}/#token={token}")
    page.wait_for_selector("html[data-connected=true]", timeout=20_000)
    page.wait_for_selector("#readings tr")
    page.click("button[data-ask=stop]")
    page.click("#yes")
    page.wait_for_selector("#connection:has-text('Stopped by the operator')", timeout=60_000)
    result["connection"] = page.text_content("#connection")
    browser.close()
result["exit"] = run.wait(60)
json.dump(result, sys.stdout)
