#!/usr/bin/env bash
# The HTTP interface as a stranger uses it, with curl alone: upload, job, spectrum, samples, ranges, conditions, drain.
# Usage: http.sh BINARY
set -euo pipefail
binary=$(realpath "${1:?usage: http.sh BINARY}")
root=$(cd "$(dirname "$0")/../.." && pwd)
scratch=$(mktemp -d)
server=
finish() {
  if [ -n "$server" ]; then kill "$server" 2>/dev/null || true; fi
  rm -rf "$scratch"
}
trap finish EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }
# The first string or number under a name in a JSON text.
field() { grep -oE "\"$1\" *: *(\"[^\"]*\"|[^,}]*)" | sed -nE '1s/^[^:]*: *"?([^"]*)"?$/\1/p'; }
is() { [ "$2" = "$3" ] || fail "$1: found $2, expected $3"; }

"$binary" serve --data "$scratch/data" --listen 127.0.0.1:0 >"$scratch/out" 2>"$scratch/log" &
server=$!
for _ in $(seq 100); do
  grep -q '^listening on http' "$scratch/out" && break
  kill -0 "$server" 2>/dev/null || fail "serve ended: $(cat "$scratch/log")"
  sleep 0.1
done
base=$(sed -n 's/^listening on //p' "$scratch/out")
[ -n "$base" ] || fail "serve did not say where it listens"
call() { curl -sS --max-time 60 "$@"; }
status() { call -o /dev/null -w '%{http_code}' "$@"; }
address=${base#http://}

is healthz "$(status "$base/healthz")" 200
is readyz "$(status "$base/readyz")" 200
"$binary" health "$base" >/dev/null || fail "health does not see the service"
"$binary" health --listen "$address" >/dev/null || fail "health --listen does not see the service"
taken=$("$binary" serve --data "$scratch/other" --listen "$address" 2>&1) && fail "two services on one address"
case "$taken" in *taken*) ;; *) fail "address in use: $taken" ;; esac

# Upload, twice, and once more as gzip: one measurement.
lamp="$root/data/aerolamp.ies"
is "first upload" "$(status --data-binary "@$lamp" "$base/v1/measurements?filename=aerolamp.ies")" 201
is "second upload" "$(status --data-binary "@$lamp" "$base/v1/measurements?filename=aerolamp.ies")" 200
id=$(call --data-binary "@$lamp" "$base/v1/measurements?filename=aerolamp.ies" | field id)
case "$id" in b3-*) ;; *) fail "measurement id is $id" ;; esac
gzip -c "$lamp" >"$scratch/lamp.gz"
again=$(call -H 'Content-Encoding: gzip' --data-binary "@$scratch/lamp.gz" "$base/v1/measurements?filename=aerolamp.ies" | field id)
is "gzip upload" "$again" "$id"
call "$base/v1/measurements/$id/content" | cmp -s - "$lamp" || fail "the original bytes differ"

# Uploads the lamp in two parts, by the protocol of resumable uploads.
tus=(-H 'Tus-Resumable: 1.0.0' -H 'Content-Type: application/offset+octet-stream')
size=$(wc -c <"$lamp")
location=$(call -D - -o /dev/null -X POST -H 'Tus-Resumable: 1.0.0' -H "Upload-Length: $size" "$base/v1/uploads" |
  tr -d '\r' | sed -n 's/^location: //p')
head -c 1000 "$lamp" >"$scratch/part-1"
tail -c +1001 "$lamp" >"$scratch/part-2"
is "first part" "$(status -X PATCH "${tus[@]}" -H 'Upload-Offset: 0' --data-binary "@$scratch/part-1" "$base$location")" 204
is "first part again" "$(status -X PATCH "${tus[@]}" -H 'Upload-Offset: 0' --data-binary "@$scratch/part-1" "$base$location")" 409
is "second part" "$(status -X PATCH "${tus[@]}" -H 'Upload-Offset: 1000' --data-binary "@$scratch/part-2" "$base$location")" 204
is "upload used" "$(call -X POST "$base/v1/measurements?upload=${location##*/}" | field id)" "$id"

# A material made elsewhere, twice.
"$binary" compress "$lamp" -o "$scratch/lamp.wlm" --er-l2 0.02 >/dev/null 2>&1 || fail "compress"
is "material of elsewhere" "$(status --data-binary "@$scratch/lamp.wlm" "$base/v1/materials?tags=elsewhere")" 201
is "material of elsewhere again" "$(status --data-binary "@$scratch/lamp.wlm" "$base/v1/materials")" 200

# A job to its end.
job=$(call -H 'Content-Type: application/json' -d "{\"measurement\":\"$id\",\"target\":{\"er_l2\":0.01}}" "$base/v1/jobs" | field id)
for _ in $(seq 300); do
  state=$(call "$base/v1/jobs/$job" | field state)
  case "$state" in succeeded) break ;; queued|running) sleep 0.2 ;; *) fail "job $state: $(call "$base/v1/jobs/$job")" ;; esac
done
is "job" "$state" succeeded
material=$(call "$base/v1/jobs/$job" | field material)
case "$material" in b3-*) ;; *) fail "material id is $material" ;; esac
waited=$(call -H 'Content-Type: application/json' -H 'Prefer: wait=30' \
  -d "{\"measurement\":\"$id\",\"target\":{\"er_l2\":0.01}}" "$base/v1/jobs")
is "the same job again" "$(printf '%s' "$waited" | field material)" "$material"

# Downloads like a renderer: whole, in part, not at all if it has the file.
content="$base/v1/materials/$material/content"
call -D "$scratch/head" -o "$scratch/lamp.wlm" "$content"
etag=$(sed -n 's/^[Ee][Tt][Aa][Gg]: *//p' "$scratch/head" | tr -d '\r')
[ -n "$etag" ] || fail "no ETag"
grep -qi '^cache-control:.*immutable' "$scratch/head" || fail "not immutable"
"$binary" compress "$lamp" -o "$scratch/own.wlm" --er-l2 0.01 >/dev/null
cmp -s "$scratch/lamp.wlm" "$scratch/own.wlm" || fail "the service and the command line made different bytes"
is "If-None-Match" "$(status -H "If-None-Match: $etag" "$content")" 304
is "Range" "$(status -H 'Range: bytes=0-9' "$content")" 206
is "ten bytes" "$(call -H 'Range: bytes=0-9' "$content" | wc -c | tr -d ' ')" 10
call -H 'Range: bytes=4-19' "$content" | cmp -s - <(dd if="$scratch/lamp.wlm" bs=1 skip=4 count=16 2>/dev/null) ||
  fail "a range has other bytes"
is "HEAD" "$(status -I "$content")" 200
is "by digest" "$(status "$base/v1/blobs/$material")" 200

# Spectra and samples, the same as from the command line.
here=$(call "$base/v1/materials/$material/spectrum?wo=180,0")
own=$("$binary" evaluate "$scratch/lamp.wlm" --wo 180,0)
values() { sed -E 's/.*"values" *: *\[([^]]*)\].*/\1/'; }
is "spectrum" "$(printf '%s' "$here" | values)" "$(printf '%s' "$own" | values)"
drawn=$(call -H 'Content-Type: application/json' -d '{"count":5,"seed":1}' "$base/v1/materials/$material/sample")
pdf=$(printf '%s' "$drawn" | sed -E 's/.*"pdf" *: *\[([^]]*)\].*/\1/' | tr ',' '\n' | grep -c .)
is "samples" "$pdf" 5

# Batches as lines and as f32: a pair in, an answer out.
lines() { printf '{"wo":[180,0]}\n{"wo":[170,0]}\n'; }
answered=$(lines | call -H 'Content-Type: application/x-ndjson' --data-binary @- "$base/v1/materials/$material/evaluate")
is "lines" "$(printf '%s\n' "$answered" | wc -l | tr -d ' ')" 2
is "the first line" "$(printf '%s\n' "$answered" | head -n 1 | values)" "$(printf '%s' "$own" | values)"
floats() { printf '\000\000\064\103\000\000\000\000%.0s' $(seq "$1"); }
samples=$(printf '%s' "$own" | values | tr ',' '\n' | grep -c .)
is "f32" "$(floats 5000 | call -H 'Content-Type: application/octet-stream' --data-binary @- \
  "$base/v1/materials/$material/evaluate" | wc -c | tr -d ' ')" "$((5000 * 4 * samples))"
is "drawn as f32" "$(call -H 'Content-Type: application/json' -H 'Accept: application/octet-stream' -d '{"count":100000}' \
  "$base/v1/materials/$material/sample" | wc -c | tr -d ' ')" 1600000
is "flux" "$(call "$base/v1/materials/$material/albedo" | values | tr ',' '\n' | grep -c .)" "$samples"
is "half a record" "$(printf '1234' | status -H 'Content-Type: application/octet-stream' --data-binary @- \
  "$base/v1/materials/$material/evaluate")" 400
is "no such media type" "$(status -H 'Content-Type: text/plain' -d 'x' "$base/v1/materials/$material/pdf")" 415
is "no such answer" "$(status -H 'Content-Type: application/json' -H 'Accept: text/html' -d '{"count":1}' \
  "$base/v1/materials/$material/sample")" 406

# Refusals are problems, with their type.
call -D "$scratch/head" -o "$scratch/problem" "$base/v1/materials/b3-$(printf '0%.0s' $(seq 64))"
grep -q '^HTTP/[0-9.]* 404' "$scratch/head" || fail "an unknown material is not 404"
grep -qi '^content-type: application/problem+json' "$scratch/head" || fail "an unknown material is no problem+json"
is "unknown route" "$(status "$base/v1/nothing")" 404
is "wrong method" "$(status -X PATCH "$base/v1/measurements")" 405
code=$(printf 'not a measurement' | status --data-binary @- "$base/v1/measurements")
case "$code" in 400|415|422) ;; *) fail "prose as a measurement: $code" ;; esac

kill -TERM "$server"
code=0
wait "$server" || code=$?
server=
is "exit code after SIGTERM" "$code" 0
echo "the HTTP interface held"
