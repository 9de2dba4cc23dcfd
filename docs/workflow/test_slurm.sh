#!/bin/sh
# Runs the groups of a job as an array of a real Slurm, on one node that is set up for it: munge, slurmctld and slurmd of
# Debian, started by this script and ended with it. One task is killed on the way and queued again.
#
#     docs/workflow/test_slurm.sh target/release/mba
#
# It needs root, and the packages munge, slurmctld, slurmd and slurm-client, which INSTALL=true has apt-get install. Without
# them it is skipped; STRICT=true makes that a failure.
set -eu
mba=$(realpath "${1:?the program, e.g. target/release/mba}")
here=$(realpath "$(dirname "$0")")
skip() {
    echo "SKIPPED: $1" >&2
    test "${STRICT:-false}" != true
    exit
}
test "$(id -u)" = 0 || skip "only root can start Slurm"
if test "${INSTALL:-false}" = true; then
    apt-get -qq install --no-install-recommends -y munge slurmctld slurmd slurm-client > /dev/null || true
fi
for program in munged slurmctld slurmd sbatch squeue; do
    command -v "$program" > /dev/null || skip "there is no $program; apt-get install munge slurmctld slurmd slurm-client"
done
if pgrep -x munged > /dev/null || pgrep -x slurmctld > /dev/null; then
    skip "Slurm is running on this machine"
fi

work=$(mktemp -d /tmp/mba-slurm.XXXXXX)
chmod 755 "$work"
started=""
end() {
    for process in $started; do kill "$process" 2> /dev/null || true; done
    for process in $started; do wait "$process" 2> /dev/null || true; done
    rm -rf "$work"
}
trap end EXIT

# A key, a socket and a log of its own: nothing of the system is touched.
mkdir "$work/munge" "$work/state" "$work/spool"
dd if=/dev/urandom of="$work/munge/key" bs=1024 count=1 2> /dev/null
chmod 700 "$work/munge"
chmod 400 "$work/munge/key"
mkdir -m 755 "$work/socket"
munged --foreground --key-file="$work/munge/key" --socket="$work/socket/munge" --pid-file="$work/munge/pid" \
    --seed-file="$work/munge/seed" --log-file="$work/munge/log" --force > /dev/null 2>&1 &
started="$!"

host=$(hostname -s)
cat > "$work/slurm.conf" << CONF
ClusterName=mba
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/socket/munge
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldPort=16817
SlurmdPort=16818
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SchedulerType=sched/backfill
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
MinJobAge=3600
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=60 State=UP
CONF
export SLURM_CONF="$work/slurm.conf"
slurmctld -D -f "$SLURM_CONF" > "$work/slurmctld.log" 2>&1 &
started="$started $!"
slurmd -D -f "$SLURM_CONF" -N "$host" > "$work/slurmd.log" 2>&1 &
started="$started $!"
tries=0
until sinfo --noheader --format=%T 2> /dev/null | grep -q idle; do
    tries=$((tries + 1))
    if test "$tries" -gt 60; then
        tail -n 20 "$work/slurmctld.log" "$work/slurmd.log" >&2
        skip "Slurm does not start here"
    fi
    sleep 1
done
echo "$(sinfo --version) on $host, $(nproc) processors"

cd "$work"
"$mba" synth --frames 18 --size 96x72 --blur 2 --out data --quiet > /dev/null
"$mba" track data --out run --quiet > /dev/null
"$mba" split run --out job --group-keyframes 8 --keyframe-motion 0 --quiet > /dev/null
mkdir hand
cp job/submaps.json hand
last=$(($("$mba" status job --json | grep -c '"state"') - 1))
id=$(MBA="$mba" sbatch --parsable --array="0-$last" --cpus-per-task=1 --mem=0 --output="$work/task-%a.log" \
    "$here/array.sh" "$work/job")
# The first task goes back into the queue as soon as it has something to go on from.
tries=0
until test -e job/000/checkpoint || test -e job/000/submap.json || test "$tries" -gt 600; do
    tries=$((tries + 1))
    sleep 0.1
done
scontrol requeue "${id}_0" 2> /dev/null && echo "task 0 was killed and queued again" || true
tries=0
while test -n "$(squeue --noheader --job "$id" --states=PENDING,RUNNING,COMPLETING,CONFIGURING 2> /dev/null)"; do
    tries=$((tries + 1))
    test "$tries" -lt 900 || { squeue; exit 1; }
    sleep 1
done
"$mba" status job
"$mba" merge job --out whole --quiet > /dev/null
"$mba" map hand --jobs 1 --quiet > /dev/null
"$mba" merge hand --out whole-by-hand --quiet > /dev/null
for name in map.ply exposures.txt trajectory.txt frames.csv; do
    cmp "whole/$name" "whole-by-hand/$name"
done
echo "the array of Slurm gives the same map as one process after the other"
