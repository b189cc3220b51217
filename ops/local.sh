#!/usr/bin/env bash
# Database, store, two API nodes and two workers on this machine without a container engine, as in ops/compose.yaml.
#   ops/local.sh DIR start     starts what does not run yet, and prints the addresses
#   ops/local.sh DIR status    one line for each process; exit code 1 if one of them is missing
#   ops/local.sh DIR stop      stops everything; running jobs get WAVELUME_DRAIN (10s) to end, then go back to the queue
#
# DIR holds everything: the database cluster (postgres), a data directory for each process, logs, and the file
# `environment` with the variables that other commands need: set -a; . DIR/environment; wavelume fsck
# Read from the environment:
#   WAVELUME            the program; by default `wavelume` of PATH, else the one built in target/
#   NODE_PORT           port of the first node, the second has the next one; 0 takes free ports; default 8081
#   AWS_ENDPOINT_URL    an S3 server of your own, with AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and WAVELUME_STORE.
#                       Without it moto is started, which keeps objects in memory: then each start begins empty.
#                       A directory keeps the kind of its first start
#   WAVELUME_PYTHON     the Python that has moto; default python3
#   WAVELUME_LEASE and all other settings of docs/settings.md reach the nodes and the workers
set -uo pipefail

usage() { sed -n '2,5s/^# \{0,1\}//p' "$0" >&2; exit 2; }
[ $# -eq 2 ] || usage
fail() { echo "ops/local.sh: $*" >&2; exit 1; }
root=$(cd "$(dirname "$0")/.." && pwd)
case "$2" in start | stop | status) ;; *) usage ;; esac
[ "$2" = start ] && { mkdir -p "$1" || exit 1; }
dir=$(cd "$1" 2>/dev/null && pwd) || fail "no such directory: $1"
NAMES="node-1 node-2 worker-1 worker-2"

# The start time beside the process id: a number that another process has got since is not taken for ours.
# A process that has ended but whose parent has not asked for its exit code yet (state Z) does not live.
born() { ps -o stat=,lstart= -p "$1" 2>/dev/null | sed '/^Z/d; s/^[^ ]* *//'; }
pid_of() {
  local pid time
  { read -r pid && read -r time; } 2>/dev/null <"$dir/pids/$1" || return 1
  [ -n "$time" ] && [ "$(born "$pid")" = "$time" ] && echo "$pid"
}
# A session of its own keeps Ctrl-C and a closed terminal away from it.
launch() {
  local name=$1 pid
  shift
  : >"$dir/logs/$name.log"
  setsid "$@" </dev/null >>"$dir/logs/$name.log" 2>&1 &
  pid=$!
  { echo "$pid"; born "$pid"; } >"$dir/pids/$name"
}
# Waits until a command succeeds, for as long as the process lives.
await() {
  local name=$1
  shift
  until "$@" >/dev/null 2>&1; do
    pid_of "$name" >/dev/null || {
      tail -5 "$dir/logs/$name.log" >&2
      fail "$name has ended, its log is $dir/logs/$name.log; stop the rest by: ops/local.sh $dir stop"
    }
    sleep 0.2
  done
}

# PostgreSQL refuses to run as root.
as=()
[ "$(id -u)" -eq 0 ] && as=(setpriv --reuid=nobody --regid=nogroup --clear-groups)
find_postgres() {
  bin=$(ls -d /usr/lib/postgresql/*/bin /usr/local/pgsql/bin 2>/dev/null | sort -V | tail -1)
  [ -n "$bin" ] || bin=$(dirname "$(command -v initdb 2>/dev/null || echo none/none)")
  [ -x "$bin/initdb" ] || fail "initdb is missing; install PostgreSQL 13 or newer (Debian: apt install postgresql)"
}
postgres() { (cd "$dir/postgres" && "${as[@]}" "$bin/pg_ctl" -D "$dir/postgres/data" -l "$dir/postgres/log" -s -w "$@"); }
postgres_runs() { [ -f "$dir/postgres/data/postmaster.pid" ] && postgres status >/dev/null 2>&1; }

address_of() { sed -n 's/^listening on //p' "$dir/logs/$1.log" 2>/dev/null | tail -1; }

status() {
  local missing=0 name pid
  find_postgres
  line() { printf '%-9s %-8s %s\n' "$1" "$2" "$3"; }
  if postgres_runs; then
    line postgres running "$(sed -n 's/^WAVELUME_DATABASE=//p' "$dir/environment")"
  else
    line postgres stopped ""
    missing=1
  fi
  for name in $([ -f "$dir/pids/s3" ] && echo s3) $NAMES; do
    if pid=$(pid_of "$name"); then
      line "$name" running "process $pid, $(address_of "$name" | grep . || echo "log $dir/logs/$name.log")"
    else
      line "$name" stopped ""
      missing=1
    fi
  done
  return $missing
}

stop() {
  local name pid told=
  find_postgres
  # All at once: a worker that drains needs neither node, but the database and the store.
  for name in $NAMES; do pid=$(pid_of "$name") && kill -TERM "$pid"; done
  for name in $NAMES; do
    while pid=$(pid_of "$name"); do
      [ -n "$told" ] || echo "waiting for running requests and jobs to end, at most the drain time"
      told=yes
      sleep 0.2
    done
    rm -f "$dir/pids/$name"
  done
  if pid=$(pid_of s3); then
    kill -TERM "$pid"
    while pid_of s3 >/dev/null; do sleep 0.1; done
  fi
  rm -f "$dir/pids/s3"
  if postgres_runs; then postgres -m fast stop || fail "PostgreSQL did not stop, its log is $dir/postgres/log"; fi
  echo "stopped"
}

start() {
  local program name number port url own_store=
  find_postgres
  local built=("$root/target/release/wavelume" "$root/target/debug/wavelume")
  program=${WAVELUME:-$(command -v wavelume || ls "${built[@]}" 2>/dev/null | head -1)}
  [ -x "$program" ] || fail "wavelume is missing; build it by cargo build --release, or name it in the variable WAVELUME"
  program=$(realpath "$program")
  local python=${WAVELUME_PYTHON:-python3}
  command -v "$python" >/dev/null || fail "python3 is missing; install Python 3 (Debian: apt install python3)"
  command -v setsid >/dev/null || fail "setsid is missing; install util-linux"
  # A directory keeps the kind of store of its first start: the variable may stem from DIR/environment of another start.
  [ -f "$dir/postgres/of-moto" ] && unset AWS_ENDPOINT_URL
  if [ -z "${AWS_ENDPOINT_URL:-}" ]; then
    own_store=yes
    "$python" -c 'import moto.server' 2>/dev/null ||
      fail "moto is missing from $python; pip install 'moto[server]', or name an S3 server in AWS_ENDPOINT_URL"
  elif [ -z "${WAVELUME_STORE:-}" ]; then
    fail "AWS_ENDPOINT_URL is set: name the bucket, too, for example WAVELUME_STORE=s3://wavelume"
  fi
  mkdir -p "$dir/logs" "$dir/pids"
  free_port() { "$python" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }

  # An empty store beside a full catalog would be refused: they begin together.
  if [ -n "$own_store" ] && ! pid_of s3 >/dev/null; then
    postgres_runs && fail "the database runs without the store that lost its objects; ops/local.sh $dir stop"
    if [ -d "$dir/postgres" ] && [ ! -f "$dir/postgres/of-moto" ]; then
      fail "$dir was started with an S3 server of your own; set AWS_ENDPOINT_URL again, or choose another directory"
    fi
    rm -rf "$dir/postgres" "$dir/environment"
  fi

  if ! postgres_runs; then
    if [ ! -d "$dir/postgres/data" ]; then
      mkdir -p "$dir/postgres"
      [ -z "$own_store" ] || : >"$dir/postgres/of-moto"
      (umask 077 && "$python" -c 'import secrets; print(secrets.token_hex(16))' >"$dir/postgres/password")
      if [ "$(id -u)" -eq 0 ]; then
        chown -R nobody "$dir/postgres"
        (cd / && "${as[@]}" test -x "$dir/postgres") ||
          fail "PostgreSQL runs as the user nobody, who may not enter $dir; choose a directory that others may enter"
      fi
      # Identifiers are compared byte by byte: locale C.
      (cd "$dir/postgres" && "${as[@]}" "$bin/initdb" -D data --locale=C -E UTF8 -A scram-sha-256 -U wavelume \
        --pwfile=password >initdb.log 2>&1) || { tail -5 "$dir/postgres/initdb.log" >&2; fail "initdb failed"; }
    fi
    port=$(free_port)
    postgres -o "-p $port -c listen_addresses=127.0.0.1 -c unix_socket_directories=''" start ||
      { tail -5 "$dir/postgres/log" >&2; fail "PostgreSQL did not start, its log is $dir/postgres/log"; }
    (umask 077 && echo "127.0.0.1:*:*:wavelume:$(cat "$dir/postgres/password")" >"$dir/pgpass")
    url=postgres://wavelume@127.0.0.1:$port/postgres
  else
    url=$(sed -n 's/^WAVELUME_DATABASE=//p' "$dir/environment")
  fi
  export WAVELUME_DATABASE=$url PGPASSFILE=$dir/pgpass

  if [ -n "$own_store" ]; then
    if pid_of s3 >/dev/null; then
      set -a
      . "$dir/environment"
      set +a
    else
      port=$(free_port)
      export AWS_ENDPOINT_URL=http://127.0.0.1:$port AWS_ACCESS_KEY_ID=test AWS_SECRET_ACCESS_KEY=test
      export WAVELUME_STORE=s3://wavelume
      launch s3 "$python" -m moto.server -H 127.0.0.1 -p "$port"
      await s3 "$python" -c 'import sys, urllib.request as r; r.urlopen(r.Request(sys.argv[1], method="PUT"))' \
        "$AWS_ENDPOINT_URL/wavelume"
    fi
  fi
  export AWS_REGION=${AWS_REGION:-us-east-1}
  # Commands such as fsck stage bytes here.
  (umask 077 && {
    printf '%s=%q\n' WAVELUME_DATABASE "$WAVELUME_DATABASE" PGPASSFILE "$PGPASSFILE" WAVELUME_STORE "$WAVELUME_STORE"
    printf '%s=%q\n' WAVELUME_DATA "$dir/commands"
    env | grep '^AWS_' | sort
  } >"$dir/environment")

  WAVELUME_DATA=$dir/commands "$program" migrate >"$dir/logs/migrate.log" 2>&1 ||
    { tail -1 "$dir/logs/migrate.log" >&2; fail "the schema is not up to date, the log is $dir/logs/migrate.log"; }

  export WAVELUME_DRAIN=${WAVELUME_DRAIN:-10s}
  port=${NODE_PORT:-8081}
  for number in 1 2; do
    name=node-$number
    if ! pid_of "$name" >/dev/null; then
      launch "$name" "$program" serve --workers 0 --data "$dir/$name" --listen "127.0.0.1:$port"
    fi
    name=worker-$number
    if ! pid_of "$name" >/dev/null; then
      launch "$name" "$program" worker --data "$dir/$name"
    fi
    [ "$port" = 0 ] || port=$((port + 1))
  done
  for name in node-1 node-2; do
    await "$name" grep -q '^listening on' "$dir/logs/$name.log"
    await "$name" "$program" health "$(address_of "$name")"
  done
  for name in worker-1 worker-2; do await "$name" grep -q '^working on' "$dir/logs/$name.log"; done
  status
}

"$2"
