#compdef lenticule
# bash and zsh completion for lenticule

# What may follow a command, or a flag behind its command.
_lenticule_load() {
  local place next flags about
  typeset -gA _lenticule_words _lenticule_flags
  while IFS=: read -r place next flags about; do
    if [[ -z $place ]]; then continue; fi
    _lenticule_words[$place]=$next
    _lenticule_flags[$place]=$flags
  done <<<'@table@'
}
_lenticule_load

# Sets next and flags to what may follow these words; next is empty where a file may.
_lenticule_next() {
  local word place help command=lenticule
  for word in '' "$@"; do
    if [[ $word == '=' ]]; then continue; fi # bash separates --flag=value
    place="$command${word:+ $word}"
    if [[ -z ${_lenticule_words[$place]+known} ]]; then
      place=$command
    elif [[ $word != -* ]]; then
      command=$place
    fi
  done
  next=${_lenticule_words[$place]}
  flags=${_lenticule_flags[$place]}
  # Another program has the command and knows what may follow.
  if [[ $next == '?' ]]; then
    next=
    if [[ ${@: -1} == -* ]]; then return; fi
    word=$2
    if [[ $word == -* ]]; then word=; fi
    help=$(lenticule "$1" $word --help 2>/dev/null)
    next=$(sed -n 's/^  \([a-z][a-z-]*\)  .*/\1/p' <<<"$help")
    flags=$(sed -n 's/^  \(-.,\)\{0,1\}\(--[a-z-]*\).*/\2/p' <<<"$help")
  fi
}

if [[ -n $BASH_VERSION ]]; then
  _lenticule() {
    local current=${COMP_WORDS[COMP_CWORD]#=} next= flags=
    _lenticule_next "${COMP_WORDS[@]:1:COMP_CWORD-1}"
    if [[ $current == -* && -n $flags ]]; then next=$flags; fi
    COMPREPLY=($(compgen -W "$next" -- "$current"))
  }
  complete -o default -F _lenticule lenticule
else
  _lenticule() {
    local next= flags=
    _lenticule_next "${(@)words[2,CURRENT-1]}"
    if [[ $PREFIX == -* && -n $flags ]]; then next=$flags; fi
    if [[ -n $next ]]; then compadd -- ${=next}; else _files; fi
  }
  if [[ ${funcstack[1]} == _lenticule ]]; then _lenticule "$@"; else compdef _lenticule lenticule; fi
fi
