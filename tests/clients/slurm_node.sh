#!/bin/sh
# Runs a command beside a Slurm of one node, which it starts in a folder of its own and ends
# afterwards:
#
#   tests/clients/slurm_node.sh CORES COMMAND [ARGUMENT...]
#
# Needs munged, slurmctld and slurmd (Debian: slurm-wlm). They run as the user that calls, on free
# ports, and read nothing from /etc, so that a Slurm of the machine is left alone.
set -eu

[ $# -ge 2 ] || { echo "usage: $0 CORES COMMAND [ARGUMENT...]" >&2; exit 2; }
cores=$1
shift
PATH=$PATH:/usr/sbin:/sbin
folder=$(mktemp -d)
finish() {
    for daemon in slurmd slurmctld munged; do
        [ ! -s "$folder/$daemon.pid" ] || kill "$(cat "$folder/$daemon.pid")" 2> /dev/null || true
    done
    # slurmctld saves its state before it ends.
    for _ in 1 2 3 4 5 6 7 8 9 10; do
        [ -e "$folder/slurmctld.pid" ] || [ -e "$folder/slurmd.pid" ] || break
        sleep 0.5
    done
    rm -rf "$folder"
}
trap finish EXIT
trap 'exit 1' INT TERM

free_ports() {
    python3 -c 'import socket
sockets = [socket.socket() for _ in range(2)]
for each in sockets: each.bind(("127.0.0.1", 0))
print(*(each.getsockname()[1] for each in sockets))'
}
ports=$(free_ports)
user=$(id -un)
# munged refuses a folder that others may write to, and any user must reach its socket.
chmod 755 "$folder"
mkdir "$folder/state" "$folder/spool"
(umask 077 && head -c 128 /dev/urandom > "$folder/munge.key")
cat > "$folder/slurm.conf" << CONF
ClusterName=one
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=${ports% *}
SlurmdPort=${ports#* }
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
SchedulerParameters=sched_interval=1,batch_sched_delay=0
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$cores RealMemory=$((1024 * cores)) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF="$folder/slurm.conf"

fail() {
    tail -n 20 "$folder"/*.log >&2
    exit 1
}
munged --force --key-file "$folder/munge.key" --socket "$folder/munge.socket" \
    --pid-file "$folder/munged.pid" --log-file "$folder/munged.log" \
    --seed-file "$folder/munged.seed" || fail
slurmctld || fail
slurmd || fail
for _ in $(seq 60); do
    [ "$(sinfo -h -o %T 2> /dev/null)" != idle ] || break
    sleep 0.5
done
[ "$(sinfo -h -o %T)" = idle ] || fail
"$@"
